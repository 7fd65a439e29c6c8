// The pins, timers and interrupts that each image uses.  A0 to A5 are pins 14 to 19.
#pragma once
#include <stdint.h>

#include "build.h"
#include "src/hal/chip.h"

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

constexpr uint8_t SERIAL_IN = 0;
constexpr uint8_t SERIAL_OUT = 1;
constexpr uint8_t I2C_DATA = 18;
constexpr uint8_t I2C_CLOCK = 19;
constexpr uint64_t COMMON_PINS = uses(SERIAL_IN, SERIAL_OUT, I2C_DATA, I2C_CLOCK);
constexpr uint64_t COMMON_UNITS = uses(Unit::timer1, Unit::uart, Unit::i2c, Unit::converter);

#if MRL_BRIDGE
constexpr uint8_t LEFT_PWM_A = 5;   // OC0B
constexpr uint8_t LEFT_PWM_B = 6;   // OC0A
constexpr uint8_t LEFT_LOGIC = 7;
constexpr uint8_t RIGHT_PWM_A = 11;  // OC2A
constexpr uint8_t RIGHT_PWM_B = 3;   // OC2B
constexpr uint8_t RIGHT_LOGIC = 9;
constexpr uint8_t LEFT_ENCODER_A = 2;
constexpr uint8_t LEFT_ENCODER_B = 4;
constexpr uint8_t RIGHT_ENCODER_A = 8;
constexpr uint8_t RIGHT_ENCODER_B = 10;
constexpr uint8_t BATTERY = 17;
constexpr uint64_t BUILD_PINS = uses(LEFT_PWM_A, LEFT_PWM_B, LEFT_LOGIC, RIGHT_PWM_A, RIGHT_PWM_B, RIGHT_LOGIC,
                                     LEFT_ENCODER_A, LEFT_ENCODER_B, RIGHT_ENCODER_A, RIGHT_ENCODER_B, BATTERY);
constexpr uint64_t BUILD_UNITS = uses(Unit::timer0, Unit::timer2, Unit::change_b, Unit::change_d);

// The interrupt of an encoder takes A from its port's lowest bit after a shift, and B two bits above it.
constexpr bool are_encoder(uint8_t a, uint8_t b) {
  return chip::port(a) == chip::port(b) && chip::bit_of(b) == chip::bit_of(a) + 2;
}
static_assert(are_encoder(LEFT_ENCODER_A, LEFT_ENCODER_B) && chip::port(LEFT_ENCODER_A) == chip::Port::d,
              "the left encoder's channels are on port D, B two bits above A");
static_assert(are_encoder(RIGHT_ENCODER_A, RIGHT_ENCODER_B) && RIGHT_ENCODER_A == 8,
              "the right encoder's channels are D8 and D10");

// The USB port moves D0 and D1 and the bootloader moves D13, before the sketch can hold them low.
constexpr bool rests_at_start(uint8_t pin) { return pin > 1 && pin != chip::LED; }
static_assert(rests_at_start(LEFT_PWM_A) && rests_at_start(LEFT_PWM_B) && rests_at_start(LEFT_LOGIC) &&
                  rests_at_start(RIGHT_PWM_A) && rests_at_start(RIGHT_PWM_B) && rests_at_start(RIGHT_LOGIC),
              "D0, D1 and D13 move before the sketch starts: no input of a bridge may be there");

// Timer 1 is the clock.
constexpr bool can_pwm(uint8_t pin) {
  return chip::pwm_timer(pin) == Unit::timer0 || chip::pwm_timer(pin) == Unit::timer2;
}
static_assert(can_pwm(LEFT_PWM_A) && can_pwm(LEFT_PWM_B) && can_pwm(RIGHT_PWM_A) && can_pwm(RIGHT_PWM_B),
              "a pin without PWM of timer 0 or 2 has a PWM function");
#else
constexpr uint8_t XBEE_IN = 2;   // INT0, to the XBee's DOUT
constexpr uint8_t XBEE_OUT = 3;  // to the XBee's DIN
constexpr uint64_t BUILD_PINS = uses(XBEE_IN, XBEE_OUT);
constexpr uint64_t BUILD_UNITS = uses(Unit::timer2, Unit::int0);
#endif

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
