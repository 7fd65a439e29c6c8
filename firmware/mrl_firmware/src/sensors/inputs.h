// Inputs that stop the robot: bumpers, cliff sensors, and an emergency stop.  Only in builds with MRL_BRIDGE.
//
// This is not a safety device: a real emergency stop cuts the motors' power.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"

namespace mrl {
namespace inputs {

// Between begin() and the first look at the pins, all that are connected count as active.
void begin();
void end();
// Looks at the pins once a millisecond; what is active twice in a row counts.  True after a look.
bool service();
// Why no wheel may turn forward, or backward; `none` if it may.
StopReason against(bool backward);
// One bit for each input.
uint8_t connected();
uint8_t active();
// The row of the reply to 59.
void report();

}  // namespace inputs
}  // namespace mrl
