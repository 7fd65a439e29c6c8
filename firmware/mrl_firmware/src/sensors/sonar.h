// Three MB1300 sonars that fire one after another, so that they do not receive each other's pulses.
#pragma once
#include <stdint.h>

namespace mrl {
namespace sonar {

// Powers the sonars; they need 250 ms before their first reading.
void begin();
// Leaves all pins; only in builds with MRL_BRIDGE.
void end();
// Takes the curve from the configuration.
void configure();
void service();
// True while the converter works for the sonars.
bool converting();
// The rows of the reply to 7: front, left, right [cm].
void report();

// Distance [cm] of an ADC count with the curve of the configuration, or the code for no distance.
int16_t range_cm(uint16_t count);

}  // namespace sonar
}  // namespace mrl
