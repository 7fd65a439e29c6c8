// The wiring of the Uno's pins.  A0 to A5 are pins 14 to 19.
#pragma once
#include <stdint.h>

#include "build.h"

namespace mrl {
namespace pins {

constexpr uint8_t SERIAL_IN = 0;
constexpr uint8_t SERIAL_OUT = 1;
constexpr uint8_t I2C_DATA = 18;
constexpr uint8_t I2C_CLOCK = 19;

constexpr uint8_t XBEE_IN = 2;   // INT0, to the XBee's DOUT
constexpr uint8_t XBEE_OUT = 3;  // to the XBee's DIN

#if MRL_ENVIRONMENT
constexpr uint8_t ALCOHOL = 14;
constexpr uint8_t ALCOHOL_HEATER = 15;  // low: heater on
constexpr uint8_t LIGHT = 16;
constexpr uint8_t FAN = 7;
constexpr uint8_t DUST = 8;  // ICP1
constexpr uint8_t USED[] = {SERIAL_IN, SERIAL_OUT,     I2C_DATA, I2C_CLOCK, XBEE_IN, XBEE_OUT,
                            ALCOHOL,   ALCOHOL_HEATER, LIGHT,    FAN,       DUST};
static_assert(DUST == 8, "only ICP1 can time the dust sensor's pulses");
#else
constexpr uint8_t SONAR_FRONT = 14;
constexpr uint8_t SONAR_LEFT = 15;
constexpr uint8_t SONAR_RIGHT = 16;
constexpr uint8_t SONAR_TRIGGER = 12;
constexpr uint8_t SONAR_POWER = 13;
constexpr uint8_t USED[] = {SERIAL_IN,   SERIAL_OUT, I2C_DATA,    I2C_CLOCK,     XBEE_IN,    XBEE_OUT,
                            SONAR_FRONT, SONAR_LEFT, SONAR_RIGHT, SONAR_TRIGGER, SONAR_POWER};
#endif

constexpr uint8_t channel(uint8_t pin) { return static_cast<uint8_t>(pin - 14); }

// Whether `pin` is not in the table from `i` on.  C++11 allows one statement in a constexpr function.
constexpr bool differs(uint8_t pin, unsigned i) {
  return i >= sizeof USED || (USED[i] != pin && differs(pin, i + 1));
}
constexpr bool all_differ(unsigned i) { return i >= sizeof USED || (differs(USED[i], i + 1) && all_differ(i + 1)); }
static_assert(all_differ(0), "two functions share a pin");

}  // namespace pins
}  // namespace mrl
