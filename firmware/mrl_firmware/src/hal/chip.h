// What the pins of the ATmega328P can do on an Uno or a Nano.  Pins have the Arduino's numbers; A0 to A5 are 14 to 19.
#pragma once
#include <stdint.h>

namespace mrl {
namespace chip {

enum class Port : uint8_t { b, c, d };
// Parts of which the chip has one each.  A pin-change interrupt serves all pins of its port.
enum class Unit : uint8_t { none, timer0, timer1, timer2, int0, change_b, change_d, uart, i2c, converter };

constexpr uint8_t LED = 13;  // the bootloader blinks it

constexpr Port port(uint8_t pin) { return pin < 8 ? Port::d : pin < 14 ? Port::b : Port::c; }
constexpr uint8_t bit_of(uint8_t pin) { return static_cast<uint8_t>(pin < 8 ? pin : pin < 14 ? pin - 8 : pin - 14); }
constexpr uint8_t mask(uint8_t pin) { return static_cast<uint8_t>(1 << bit_of(pin)); }
// The timer whose output the pin is.
constexpr Unit pwm_timer(uint8_t pin) {
  return pin == 5 || pin == 6    ? Unit::timer0
         : pin == 9 || pin == 10 ? Unit::timer1
         : pin == 3 || pin == 11 ? Unit::timer2
                                 : Unit::none;
}
// The converter's channel of an analog pin.
constexpr uint8_t channel(uint8_t pin) { return static_cast<uint8_t>(pin - 14); }

}  // namespace chip
}  // namespace mrl
