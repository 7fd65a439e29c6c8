// What the pins of the chip can do: the ATmega328P of an Uno or a Nano, the ATmega2560 of a Mega.  Pins have the Arduino's
// numbers; A0 to A5 of an Uno are 14 to 19, A0 to A15 of a Mega 54 to 69.
#pragma once
#include <stdint.h>

#include "chip_pins.h"

namespace mrl {
namespace chip {

// The rest of a pin's row; -1 is none.
struct Functions {
  int8_t timer, unit, change, external, channel;
};
// Of a pin that the chip has.
Functions functions(int8_t pin);

#if MRL_MEGA
enum class Port : uint8_t { a, b, c, d, e, f, g, h, j, k, l };
constexpr uint8_t PORTS = 11, TIMERS = 6;

// The table of the pins has these.
Port port(uint8_t pin);
uint8_t mask(uint8_t pin);
inline uint8_t channel(uint8_t pin) { return static_cast<uint8_t>(functions(static_cast<int8_t>(pin)).channel); }
#else
enum class Port : uint8_t { b, c, d };
constexpr uint8_t PORTS = 3, TIMERS = 3;
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
#endif

constexpr int8_t FIRST_ANALOG = MRL_MEGA ? 54 : 14;  // A0
// Whether a timer, or -1, has 16 bits.
constexpr bool is_wide(int8_t timer) { return timer == 1 || (MRL_MEGA && timer > 2); }
// Whether a timer is left for the clock next to those that make PWM or the pulses of servos, a bit each: any other one, or
// one with fast PWM.
constexpr bool leaves_clock(uint8_t timers, bool fast_pwm) { return timers != (1 << TIMERS) - 1 || fast_pwm; }

}  // namespace chip
}  // namespace mrl
