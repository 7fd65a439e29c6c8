// Servos for models, which turn to an angle given by the length of their pulses.  Only in builds with MRL_BRIDGE.
#pragma once
#include <stdint.h>

namespace mrl {
namespace servo {

// With the wiring in force; no servo has pulses before its first request.
void begin();
void service();
// The row of the reply to 52.
void report(int16_t number);

}  // namespace servo
}  // namespace mrl
