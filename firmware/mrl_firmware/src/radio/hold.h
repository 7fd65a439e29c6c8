// Robots that hold this one by radio, for example while they are in a crossing.  A hold stops the motors and refuses
// moves.  Nothing here turns a motor.
#pragma once
#include <stdint.h>

#include "../../build.h"

namespace mrl {
namespace hold {

#if MRL_XBEE

void begin();
void service();
// False if holds are off: parameter 26 is 0.
bool on();
// True, and counted, if moves are refused now.
bool refuses();
// Takes a text from another radio; false if it is not a hold text or holds are off.
bool take(const uint8_t* address, const uint8_t* text, uint8_t size);
// The host gets a new reply to 49, if it has asked for one before.
void tell();

// The row of the reply to 49.
void report(int16_t undelivered);

#else

constexpr bool on() { return false; }
constexpr bool refuses() { return false; }

#endif

}  // namespace hold
}  // namespace mrl
