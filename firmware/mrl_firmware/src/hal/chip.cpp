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

}  // namespace chip
}  // namespace mrl
