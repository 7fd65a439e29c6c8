// A robot that is calculated: gearmotors, encoders, battery, body, and sonars in a rectangular room with one box.  Above
// it all is that of a real robot: the control of the wheels, the stops, the wiring.  Only in builds with MRL_VIRTUAL.
#pragma once
#include <stdint.h>

#include "../hal/hal.h"
#include "../serial/protocol.h"

namespace mrl {
namespace virtual_robot {

constexpr Bridge BRIDGE = Bridge::tb6612;  // whatever the parameter says: it needs the least to be understood

// Takes over the parameters; the robot keeps its place.
void configure();
// The levels of the pins of a motor, of 255.
void drive(uint8_t motor, const uint8_t (&duties)[hal::BRIDGE_PINS]);
// Does a part of what happens in the time of a sample, which it fills in, but for its tick; true after the last part.
bool step(hal::EncoderSample& sample);
// The counters at a tick after the newest sample: the wheels turn on as in the period before it, for at most two more.
// Returns the tick that they are of.
uint16_t counts_at(uint16_t tick, uint16_t (&counts)[hal::MOTORS]);

// What a sonar measures now: 0 front, 1 left, 2 right.
int16_t range_cm(uint8_t sonar);
// Adds the pose in the room to the reply to 62.
void report_pose();

}  // namespace virtual_robot
}  // namespace mrl
