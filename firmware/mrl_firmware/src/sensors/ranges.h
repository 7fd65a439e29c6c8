// HC-SR04 that fire in turn, so that none receives the pulse of another one, and analog sensors, which have no trigger.
// Only in builds with MRL_BRIDGE.
#pragma once
#include <stdint.h>

namespace mrl {
namespace ranges {

// Those that the wiring has, a bit each.
uint8_t connected();
// Those with a trigger.
uint8_t timed();
// Takes the pins of the wiring in force, or leaves them.
void begin();
void end();
void service();
// True while the converter works for them, so that battery and sonars must wait.
bool converting();
// The row of the reply to 61.
void report();

}  // namespace ranges
}  // namespace mrl
