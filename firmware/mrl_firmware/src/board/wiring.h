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
// The row of the reply to 51.
void report();

}  // namespace wiring
}  // namespace mrl
