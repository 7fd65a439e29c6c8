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

constexpr uint8_t ENCODERS = place_of(Parameter::pin_left_encoder_a);
constexpr uint8_t SONARS = place_of(Parameter::pin_sonar_front);
constexpr uint8_t TRIGGER = place_of(Parameter::pin_sonar_trigger);
constexpr uint8_t BATTERY = place_of(Parameter::pin_battery);
constexpr uint8_t I2C = place_of(Parameter::i2c);
static_assert(I2C == PIN_COUNT - 1, "all but the last parameter are pins");

struct Table {
  const int16_t* pins;
  Bridge bridge;
  bridge::Roles roles;

  int8_t at(uint8_t place) const { return static_cast<int8_t>(pins[place]); }
  bool connected(uint8_t place) const { return pins[place] != NOT_CONNECTED; }
  // Of a bridge's pin, by its role.
  bool needed(uint8_t place) const { return place < ENCODERS && (roles.needed >> place % hal::BRIDGE_PINS & 1); }
  bool pwm(uint8_t place) const {
    return place < ENCODERS && (roles.pwm >> place % hal::BRIDGE_PINS & 1) && connected(place);
  }
};

bool is_encoder(uint8_t place) { return place >= ENCODERS && place < SONARS; }
bool is_channel_a(uint8_t place) { return is_encoder(place) && (place - ENCODERS) % hal::CHANNELS == 0; }

// ---- each problem: whether the pin at this place has it; the places are connected from the second test on

bool is_missing(const Table& table, uint8_t place) {
  return !table.connected(place) && (table.needed(place) || is_channel_a(place));
}

bool is_not_there(const Table& table, uint8_t place) { return table.at(place) >= chip::PIN_COUNT_OF_CHIP; }

bool is_serial(const Table& table, uint8_t place) {
  return table.at(place) == chip::SERIAL_IN || table.at(place) == chip::SERIAL_OUT;
}

// The place before this one with the same pin, or this one.
uint8_t first_with_pin_of(const Table& table, uint8_t place) {
  uint8_t other = 0;
  while (table.at(other) != table.at(place)) other++;
  return other;
}

bool is_used_twice(const Table& table, uint8_t place) { return first_with_pin_of(table, place) != place; }

bool lacks_pwm(const Table& table, uint8_t place) {
  return table.pwm(place) && chip::functions(table.at(place)).timer < 0;
}

// The bootloader moves the pin of the LED.  A bridge whose PWM is held low by a resistor does not drive then.  An L298N
// whose EN is wired high does, if its other input moves.
bool is_led(const Table& table, uint8_t place) {
  if (table.at(place) != chip::LED_PIN) return false;
  const bool logic = place < ENCODERS && place % hal::BRIDGE_PINS == static_cast<uint8_t>(hal::BridgePin::logic);
  return table.pwm(place) || (logic && table.bridge == Bridge::l298n && !table.connected(static_cast<uint8_t>(place - 2)));
}

bool lacks_interrupt(const Table& table, uint8_t place) {
  if (!is_encoder(place)) return false;
  const chip::Functions functions = chip::functions(table.at(place));
  const bool silent = functions.change < 0 && functions.external < 0;
  return (silent && is_channel_a(place)) || table.at(place) == chip::NO_ENCODER_PIN;
}

bool lacks_converter(const Table& table, uint8_t place) {
  const bool analog = (place >= SONARS && place < TRIGGER) || place == BATTERY;
  return analog && chip::functions(table.at(place)).channel < 0;
}

bool is_on_bus(const Table& table, uint8_t place) {
  return table.at(I2C) && (table.at(place) == chip::I2C_DATA || table.at(place) == chip::I2C_CLOCK);
}

// Timer 1 would be the clock.
bool takes_clock(const Table& table, uint8_t place) {
  uint8_t timers = 0;
  for (uint8_t i = 0; i < ENCODERS; i++) {
    if (table.pwm(i)) timers = static_cast<uint8_t>(timers | 1 << chip::functions(table.at(i)).timer);
  }
  const bool fast_pwm = bridge::rate(table.bridge) == hal::PwmRate::medium;
  return !chip::leaves_clock(timers, fast_pwm) && table.pwm(place) && chip::functions(table.at(place)).timer == 1;
}

typedef bool Test(const Table& table, uint8_t place);

// In the order of the problems.
Test* const TESTS[] PROGMEM = {is_missing, is_not_there,    is_serial,       is_used_twice, lacks_pwm,
                               is_led,     lacks_interrupt, lacks_converter, is_on_bus,     takes_clock};
constexpr uint8_t PROBLEMS = sizeof TESTS / sizeof *TESTS;
static_assert(PROBLEMS == static_cast<uint8_t>(WiringProblem::no_clock), "a test for each problem");

}  // namespace

Finding check(const int16_t* pins, Bridge bridge) {
  const Table table = {pins, bridge, bridge::roles(bridge)};
  for (uint8_t test = 0; test < PROBLEMS; test++) {
    const WiringProblem problem = static_cast<WiringProblem>(test + 1);
    for (uint8_t place = 0; place < I2C; place++) {
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
