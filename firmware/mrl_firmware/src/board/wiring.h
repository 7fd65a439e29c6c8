// The wiring in force: which pin of the Arduino does what.  Only in builds with MRL_BRIDGE.
//
// All pins are inputs without pull-ups until the parameters hold a wiring that the chip can have.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"

namespace mrl {
namespace wiring {

// Whether it depends on the parameter.
bool depends_on(Parameter parameter);
// Puts the wiring of the parameters in force, if the bridge is set and there is no problem.
void begin();
// Switches all outputs off, and makes inputs of all pins.
void end();
// Between begin() and end(), if there was no problem.
bool accepted();
// The value in force of a parameter from PIN_FIRST on; -1 without an accepted wiring.
int8_t pin(Parameter parameter);
// The chip of the bridges, and whether the parameter `wiring` has one of these bits.
Bridge bridge();
bool has(int16_t bits);
// Number of motors and encoders in force: 0, 2 or 4.
uint8_t motors();
// Whether the channel A of an encoder is counted alone.
bool is_single(uint8_t encoder);
// The pin of a servo, or -1.
int8_t servo_pin(uint8_t servo);
// The pins of a range sensor, or -1.
int8_t range_pin(uint8_t range, bool echo);
// The row of the reply to 53.
void report_board();
// The row of the reply to 51.
void report();

}  // namespace wiring
}  // namespace mrl
