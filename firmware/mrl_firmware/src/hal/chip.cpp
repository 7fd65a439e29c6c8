#include "chip.h"

#include "flash.h"

namespace mrl {
namespace chip {

#define FUNCTIONS(number, port, bit, timer, unit, change, external, channel) {timer, unit, change, external, channel},
const Functions ROWS[] PROGMEM = {MRL_CHIP_PINS(FUNCTIONS)};
static_assert(sizeof ROWS / sizeof *ROWS == PIN_COUNT_OF_CHIP, "a row for each pin");

Functions functions(int8_t pin) {
  const uint8_t* const row = reinterpret_cast<const uint8_t*>(&ROWS[pin]);
  const auto number = [row](uint8_t place) { return static_cast<int8_t>(flash_byte(row + place)); };
  return {number(0), number(1), number(2), number(3), number(4)};
}

#if MRL_MEGA
#define PLACE(number, letter, bit, ...) {static_cast<uint8_t>(Port::letter), 1 << bit},
const uint8_t PLACES[][2] PROGMEM = {MRL_CHIP_PINS(PLACE)};

Port port(uint8_t pin) { return static_cast<Port>(flash_byte(&PLACES[pin][0])); }
uint8_t mask(uint8_t pin) { return flash_byte(&PLACES[pin][1]); }
#endif

}  // namespace chip
}  // namespace mrl
