// The pins, timers and interrupts that each image uses.  A0 to A5 are pins 14 to 19.  With MRL_BRIDGE they are parameters
// of the board: src/board/wiring.h.
#pragma once
#include <stdint.h>

#include "build.h"
#include "src/hal/chip.h"

#if !MRL_BRIDGE
namespace mrl {
namespace pins {

using chip::Unit;

// How many functions use each pin, or each unit of the chip: an octal digit for each.
constexpr uint64_t uses() { return 0; }
template <typename First, typename... Rest>
constexpr uint64_t uses(First first, Rest... rest) {
  return (uint64_t{1} << 3 * static_cast<uint8_t>(first)) + uses(rest...);
}
constexpr bool all_differ(uint64_t uses) { return !(uses & 0666666666666666666666); }

constexpr uint64_t COMMON_PINS = uses(chip::SERIAL_IN, chip::SERIAL_OUT, chip::I2C_DATA, chip::I2C_CLOCK);
constexpr uint64_t COMMON_UNITS = uses(Unit::timer1, Unit::uart, Unit::i2c, Unit::converter);

constexpr uint8_t XBEE_IN = 2;   // INT0, to the XBee's DOUT
constexpr uint8_t XBEE_OUT = 3;  // to the XBee's DIN
constexpr uint64_t BUILD_PINS = uses(XBEE_IN, XBEE_OUT);
constexpr uint64_t BUILD_UNITS = uses(Unit::timer2, Unit::int0);

#if MRL_ENVIRONMENT
constexpr uint8_t ALCOHOL = 14;
constexpr uint8_t ALCOHOL_HEATER = 15;  // low: heater on
constexpr uint8_t LIGHT = 16;
constexpr uint8_t FAN = 7;
constexpr uint8_t DUST = 8;  // ICP1
constexpr uint64_t SENSOR_PINS = uses(ALCOHOL, ALCOHOL_HEATER, LIGHT, FAN, DUST);
static_assert(DUST == 8, "only ICP1 can time the dust sensor's pulses");
#else
constexpr uint8_t SONAR_FRONT = 14;
constexpr uint8_t SONAR_LEFT = 15;
constexpr uint8_t SONAR_RIGHT = 16;
constexpr uint8_t SONAR_TRIGGER = 12;
constexpr uint8_t SONAR_POWER = 13;
constexpr uint64_t SENSOR_PINS = uses(SONAR_FRONT, SONAR_LEFT, SONAR_RIGHT, SONAR_TRIGGER, SONAR_POWER);
#endif

static_assert(all_differ(COMMON_PINS + BUILD_PINS + SENSOR_PINS), "two functions share a pin");
static_assert(all_differ(COMMON_UNITS + BUILD_UNITS), "two functions share a timer or an interrupt");

}  // namespace pins
}  // namespace mrl
#endif
