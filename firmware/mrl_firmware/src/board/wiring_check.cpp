#include "../../build.h"

#if MRL_BRIDGE

#include "wiring_check.h"

#include "../hal/chip.h"
#include "../hal/flash.h"
#include "../hal/hal.h"
#include "../motors/bridge.h"

namespace mrl {
namespace wiring {
namespace {

constexpr uint8_t place_of(Parameter parameter) { return static_cast<uint8_t>(static_cast<uint8_t>(parameter) - PIN_FIRST); }

constexpr uint8_t ENDS = WIRES + MOTORS_TOGETHER * hal::CHANNELS;  // of the pins of two motors
constexpr uint8_t SONARS = place_of(Parameter::pin_sonar_front);
constexpr uint8_t TRIGGER = place_of(Parameter::pin_sonar_trigger);
constexpr uint8_t BATTERY = place_of(Parameter::pin_battery);
constexpr uint8_t I2C = place_of(Parameter::i2c);
constexpr uint8_t FIRST_SERVO = place_of(Parameter::pin_servo_1);
constexpr uint8_t THIRD_SERVO = place_of(Parameter::pin_servo_3);
constexpr uint8_t RELEASE = place_of(Parameter::servo_release);
constexpr uint8_t NO_ENCODERS = place_of(Parameter::no_encoders);
constexpr uint8_t INPUTS = place_of(Parameter::pin_bumper_left);
constexpr uint8_t LEVELS = place_of(Parameter::bumpers_high), LEVELS_END = LEVELS + 2;
constexpr uint8_t FIRST_RANGE = place_of(Parameter::pin_range_1_trigger);
constexpr uint8_t FOURTH_RANGE = place_of(Parameter::pin_range_4_trigger);
constexpr uint8_t AIR = place_of(Parameter::air_temperature);
static_assert(ENDS == SONARS && I2C < REAR, "the pins of two motors come first, those of a Mega last");

// The same function of the front motors, or at least ENDS for others.
uint8_t of_two(uint8_t place) { return MRL_MEGA && place >= REAR ? static_cast<uint8_t>(place - REAR) : place; }
bool is_wire(uint8_t place) { return of_two(place) < WIRES; }
bool is_encoder(uint8_t place) { return of_two(place) >= WIRES && of_two(place) < ENDS; }
bool is_channel_a(uint8_t place) { return is_encoder(place) && (of_two(place) - WIRES) % hal::CHANNELS == 0; }

struct Table {
  const int8_t* pins;
  Bridge bridge;
  bridge::Roles roles;

  int8_t at(uint8_t place) const { return pins[place]; }
  // All but a few parameters are pins.
  bool connected(uint8_t place) const {
    const bool flag = place == I2C || place == RELEASE || place == NO_ENCODERS || place == AIR ||
                      (place >= LEVELS && place < LEVELS_END);
    return !flag && pins[place] != NOT_CONNECTED;
  }
  // Of a bridge's pin, by its role.
  bool needed(uint8_t place) const { return is_wire(place) && (roles.needed >> of_two(place) % hal::BRIDGE_WIRES & 1); }
  bool pwm(uint8_t place) const {
    return is_wire(place) && (roles.pwm >> of_two(place) % hal::BRIDGE_WIRES & 1) && connected(place);
  }
  // The rear motors have any pin.
  bool has_rear() const {
    for (uint8_t place = REAR; place < REAR + ENDS && MRL_MEGA; place++) {
      if (connected(place)) return true;
    }
    return false;
  }
};

bool is_servo(uint8_t place) {
  if (place >= FIRST_SERVO && place < FIRST_SERVO + SERVOS_OF_UNO) return true;
  return MRL_MEGA && place >= THIRD_SERVO && place < THIRD_SERVO + hal::SERVOS - SERVOS_OF_UNO;
}
// Behind its trigger.
bool is_echo(uint8_t place) {
  if (MRL_MEGA && place >= FOURTH_RANGE) return (place - FOURTH_RANGE) % 2;
  return place >= FIRST_RANGE && place < FIRST_RANGE + 2 * RANGES_OF_UNO && (place - FIRST_RANGE) % 2;
}
// The echo of a sensor with a trigger; without one, the sensor is analog.
bool is_timed(const Table& table, uint8_t place) {
  return is_echo(place) && table.connected(static_cast<uint8_t>(place - 1));
}

// ---- each problem: whether the pin at this place has it; the places are connected from the second test on

bool is_missing(const Table& table, uint8_t place) {
  if (table.connected(place)) return false;
  if (is_timed(table, place)) return true;
  if (!table.needed(place) && (!is_channel_a(place) || table.at(NO_ENCODERS))) return false;
  return place < ENDS || table.has_rear();
}

bool is_not_there(const Table& table, uint8_t place) { return table.at(place) >= chip::PIN_COUNT_OF_CHIP; }

bool is_serial(const Table& table, uint8_t place) {
  return table.at(place) == chip::SERIAL_IN || table.at(place) == chip::SERIAL_OUT;
}

// The place before this one with the same pin, or this one.
uint8_t first_with_pin_of(const Table& table, uint8_t place) {
  uint8_t other = 0;
  while (!table.connected(other) || table.at(other) != table.at(place)) other++;
  return other;
}

bool is_used_twice(const Table& table, uint8_t place) { return first_with_pin_of(table, place) != place; }

bool lacks_pwm(const Table& table, uint8_t place) {
  return table.pwm(place) && chip::functions(table.at(place)).timer < 0;
}

// The bootloader drives the pin of the LED, which a closed switch, an encoder or an echo shorts.  A bridge whose PWM is held low by a resistor
// does not drive then.  An L298N whose EN is wired high does, if its other input moves.
bool is_led(const Table& table, uint8_t place) {
  if (table.at(place) != chip::LED_PIN) return false;
  const bool logic = is_wire(place) && of_two(place) % hal::BRIDGE_WIRES == static_cast<uint8_t>(hal::BridgePin::logic);
  if (table.pwm(place) || (place >= INPUTS && place < LEVELS) || is_encoder(place) || is_timed(table, place)) return true;
  return logic && table.bridge == Bridge::l298n && !table.connected(static_cast<uint8_t>(place - 2));
}

bool lacks_interrupt(const Table& table, uint8_t place) {
  const chip::Functions functions = chip::functions(table.at(place));
  return functions.change < 0 && functions.external < 0 && (is_channel_a(place) || is_timed(table, place));
}

bool lacks_converter(const Table& table, uint8_t place) {
  const bool analog =
      (place >= SONARS && place < TRIGGER) || place == BATTERY || (is_echo(place) && !is_timed(table, place));
  return analog && chip::functions(table.at(place)).channel < 0;
}

bool is_on_bus(const Table& table, uint8_t place) {
  return table.at(I2C) && (table.at(place) == chip::I2C_DATA || table.at(place) == chip::I2C_CLOCK);
}

// The timers of the motors' PWM or of the servos, a bit each; all of them have these outputs.
uint8_t timers_of(const Table& table, bool servos) {
  uint8_t timers = 0;
  for (uint8_t i = 0; i < PIN_COUNT; i++) {
    const bool used = servos ? is_servo(i) && table.connected(i) : table.pwm(i);
    if (used) timers = static_cast<uint8_t>(timers | 1 << chip::functions(table.at(i)).timer);
  }
  return timers;
}

bool lacks_pulses(const Table& table, uint8_t place) {
  if (!is_servo(place)) return false;
  const int8_t timer = chip::functions(table.at(place)).timer;
  return !chip::is_wide(timer) || (timers_of(table, false) >> timer & 1);
}

// Timer 1 would be the clock.
bool takes_clock(const Table& table, uint8_t place) {
  const uint8_t timers = static_cast<uint8_t>(timers_of(table, false) | timers_of(table, true));
  const bool fast_pwm = bridge::rate(table.bridge) == hal::PwmRate::medium;
  if (chip::leaves_clock(timers, fast_pwm) || !(table.pwm(place) || is_servo(place))) return false;
  return chip::functions(table.at(place)).timer == 1;
}

typedef bool Test(const Table& table, uint8_t place);

// In the order of the problems.
Test* const TESTS[] PROGMEM = {is_missing, is_not_there,    is_serial,       is_used_twice, lacks_pwm,
                               is_led,     lacks_interrupt, lacks_converter, is_on_bus,     lacks_pulses,
                               takes_clock};
constexpr uint8_t PROBLEMS = sizeof TESTS / sizeof *TESTS;
static_assert(PROBLEMS == static_cast<uint8_t>(WiringProblem::no_clock), "a test for each problem");

}  // namespace

Finding check(const int8_t* pins, Bridge bridge) {
  const Table table = {pins, bridge, bridge::roles(bridge)};
  for (uint8_t test = 0; test < PROBLEMS; test++) {
    const WiringProblem problem = static_cast<WiringProblem>(test + 1);
    for (uint8_t place = 0; place < PIN_COUNT; place++) {
      if (test && !table.connected(place)) continue;
      if (!flash_pointer(&TESTS[test])(table, place)) continue;
      const bool twice = problem == WiringProblem::pin_used_twice;
      const int8_t other = static_cast<int8_t>(twice ? PIN_FIRST + first_with_pin_of(table, place) : -1);
      return {problem, static_cast<int8_t>(PIN_FIRST + place), other};
    }
  }
  return {WiringProblem::none, -1, -1};
}

}  // namespace wiring
}  // namespace mrl

#endif
