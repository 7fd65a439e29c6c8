// The pins, timers and interrupts that each image uses.  A0 to A5 are pins 14 to 19.
#pragma once
#include <stdint.h>

#include "build.h"
#include "src/hal/chip.h"

namespace mrl {
namespace pins {

using chip::Unit;

// What a function needs of its pin, apart from having it alone.
enum class Need : uint8_t { nothing, bridge, pwm, encoder };

struct Use {
  uint8_t pin;
  Need need;
};

constexpr uint8_t SERIAL_IN = 0;
constexpr uint8_t SERIAL_OUT = 1;
constexpr uint8_t I2C_DATA = 18;
constexpr uint8_t I2C_CLOCK = 19;
constexpr Use USED[] = {
    {SERIAL_IN, Need::nothing}, {SERIAL_OUT, Need::nothing}, {I2C_DATA, Need::nothing}, {I2C_CLOCK, Need::nothing}};
constexpr Unit UNITS[] = {Unit::timer1, Unit::uart, Unit::i2c, Unit::converter};

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
constexpr Use USED_FOR_BUILD[] = {{LEFT_PWM_A, Need::pwm},
                                  {LEFT_PWM_B, Need::pwm},
                                  {LEFT_LOGIC, Need::bridge},
                                  {RIGHT_PWM_A, Need::pwm},
                                  {RIGHT_PWM_B, Need::pwm},
                                  {RIGHT_LOGIC, Need::bridge},
                                  {LEFT_ENCODER_A, Need::encoder},
                                  {LEFT_ENCODER_B, Need::encoder},
                                  {RIGHT_ENCODER_A, Need::encoder},
                                  {RIGHT_ENCODER_B, Need::encoder},
                                  {BATTERY, Need::nothing}};
constexpr Unit UNITS_FOR_BUILD[] = {Unit::timer0, Unit::timer2, Unit::change_b, Unit::change_d};

// The interrupt of an encoder takes A from its port's lowest bit after a shift, and B two bits above it.
constexpr bool are_encoder(uint8_t a, uint8_t b) {
  return chip::port(a) == chip::port(b) && chip::bit_of(b) == chip::bit_of(a) + 2;
}
static_assert(are_encoder(LEFT_ENCODER_A, LEFT_ENCODER_B) && chip::port(LEFT_ENCODER_A) == chip::Port::d,
              "the left encoder's channels are on port D, B two bits above A");
static_assert(are_encoder(RIGHT_ENCODER_A, RIGHT_ENCODER_B) && RIGHT_ENCODER_A == 8,
              "the right encoder's channels are D8 and D10");
#else
constexpr uint8_t XBEE_IN = 2;   // INT0, to the XBee's DOUT
constexpr uint8_t XBEE_OUT = 3;  // to the XBee's DIN
constexpr Use USED_FOR_BUILD[] = {{XBEE_IN, Need::nothing}, {XBEE_OUT, Need::nothing}};
constexpr Unit UNITS_FOR_BUILD[] = {Unit::timer2, Unit::int0};
#endif

#if MRL_ENVIRONMENT
constexpr uint8_t ALCOHOL = 14;
constexpr uint8_t ALCOHOL_HEATER = 15;  // low: heater on
constexpr uint8_t LIGHT = 16;
constexpr uint8_t FAN = 7;
constexpr uint8_t DUST = 8;  // ICP1
constexpr Use USED_FOR_SENSORS[] = {{ALCOHOL, Need::nothing},
                                    {ALCOHOL_HEATER, Need::nothing},
                                    {LIGHT, Need::nothing},
                                    {FAN, Need::nothing},
                                    {DUST, Need::nothing}};
static_assert(DUST == 8, "only ICP1 can time the dust sensor's pulses");
#else
constexpr uint8_t SONAR_FRONT = 14;
constexpr uint8_t SONAR_LEFT = 15;
constexpr uint8_t SONAR_RIGHT = 16;
constexpr uint8_t SONAR_TRIGGER = 12;
constexpr uint8_t SONAR_POWER = 13;
constexpr Use USED_FOR_SENSORS[] = {{SONAR_FRONT, Need::nothing},
                                    {SONAR_LEFT, Need::nothing},
                                    {SONAR_RIGHT, Need::nothing},
                                    {SONAR_TRIGGER, Need::nothing},
                                    {SONAR_POWER, Need::nothing}};
#endif

constexpr uint8_t channel(uint8_t pin) { return chip::channel(pin); }

// ---- checks.  C++11 allows one statement in a constexpr function.

constexpr unsigned COMMON = sizeof USED / sizeof *USED;
constexpr unsigned WITH_BUILD = COMMON + sizeof USED_FOR_BUILD / sizeof *USED_FOR_BUILD;
constexpr unsigned ALL = WITH_BUILD + sizeof USED_FOR_SENSORS / sizeof *USED_FOR_SENSORS;
constexpr Use use(unsigned i) {
  return i < COMMON ? USED[i] : i < WITH_BUILD ? USED_FOR_BUILD[i - COMMON] : USED_FOR_SENSORS[i - WITH_BUILD];
}

// Whether no function from `i` on has `pin`.
constexpr bool is_free(uint8_t pin, unsigned i) { return i >= ALL || (use(i).pin != pin && is_free(pin, i + 1)); }
constexpr bool all_differ(unsigned i) { return i >= ALL || (is_free(use(i).pin, i + 1) && all_differ(i + 1)); }
static_assert(all_differ(0), "two functions share a pin");

// The USB port moves D0 and D1 and the bootloader moves D13, before the sketch can hold them low.
constexpr bool rests_at_start(uint8_t pin) { return pin > 1 && pin != chip::LED; }
constexpr bool bridge_rests(unsigned i) {
  return i >= ALL ||
         (((use(i).need != Need::bridge && use(i).need != Need::pwm) || rests_at_start(use(i).pin)) &&
          bridge_rests(i + 1));
}
static_assert(bridge_rests(0), "D0, D1 and D13 move before the sketch starts: no input of a bridge may be there");

// Timer 1 is the clock.
constexpr bool can_pwm(uint8_t pin) {
  return chip::pwm_timer(pin) == Unit::timer0 || chip::pwm_timer(pin) == Unit::timer2;
}
constexpr bool all_can_pwm(unsigned i) {
  return i >= ALL || ((use(i).need != Need::pwm || can_pwm(use(i).pin)) && all_can_pwm(i + 1));
}
static_assert(all_can_pwm(0), "a pin without PWM of timer 0 or 2 has a PWM function");

constexpr unsigned COMMON_UNITS = sizeof UNITS / sizeof *UNITS;
constexpr unsigned ALL_UNITS = COMMON_UNITS + sizeof UNITS_FOR_BUILD / sizeof *UNITS_FOR_BUILD;
constexpr Unit unit(unsigned i) { return i < COMMON_UNITS ? UNITS[i] : UNITS_FOR_BUILD[i - COMMON_UNITS]; }
constexpr bool unit_is_free(Unit which, unsigned i) {
  return i >= ALL_UNITS || (unit(i) != which && unit_is_free(which, i + 1));
}
constexpr bool all_units_differ(unsigned i) {
  return i >= ALL_UNITS || (unit_is_free(unit(i), i + 1) && all_units_differ(i + 1));
}
static_assert(all_units_differ(0), "two functions share a timer or an interrupt");

}  // namespace pins
}  // namespace mrl
