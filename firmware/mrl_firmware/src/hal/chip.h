// What the pins of the ATmega328P can do on an Uno or a Nano.  Pins have the Arduino's numbers; A0 to A5 are 14 to 19.
#pragma once
#include <stdint.h>

#include "chip_pins.h"

namespace mrl {
namespace chip {

enum class Port : uint8_t { b, c, d };
// Parts of which the chip has one each.
enum class Unit : uint8_t { none, timer1, timer2, int0, uart, i2c, converter };

constexpr Port port(uint8_t pin) { return pin < 8 ? Port::d : pin < 14 ? Port::b : Port::c; }
constexpr uint8_t bit_of(uint8_t pin) { return static_cast<uint8_t>(pin < 8 ? pin : pin < 14 ? pin - 8 : pin - 14); }
constexpr uint8_t mask(uint8_t pin) { return static_cast<uint8_t>(1 << bit_of(pin)); }
// The converter's channel of an analog pin.
constexpr uint8_t channel(uint8_t pin) { return static_cast<uint8_t>(pin - 14); }

#define MRL_AGREES(number, letter, bit, timer, unit, change, external, converter)            \
  static_assert(port(number) == Port::letter && bit_of(number) == (bit), "port of a pin");   \
  static_assert((converter) < 0 || int{channel(number)} == (converter), "channel of a pin");
MRL_CHIP_PINS(MRL_AGREES)

// The rest of a pin's row; -1 is none.
struct Functions {
  int8_t timer, unit, change, external, channel;
};
// Of a pin that the chip has.
Functions functions(int8_t pin);

// Whether a timer is left for the clock next to those that make PWM, a bit each: any other one, or one with fast PWM.
constexpr bool leaves_clock(uint8_t timers, bool fast_pwm) { return timers != 7 || fast_pwm; }

}  // namespace chip
}  // namespace mrl
