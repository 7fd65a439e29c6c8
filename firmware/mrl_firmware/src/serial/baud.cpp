#include "baud.h"

#include "answers.h"
#include "../board/board_clock.h"
#include "../hal/flash.h"
#include "../hal/hal.h"
#include "protocol.h"

namespace mrl {
namespace baud {
namespace {

// 16 MHz / (8 (divider + 1)): 117647, which is 2.1 % above 115200, and exactly 250000, 500000, 1000000 baud.
const uint8_t DIVIDERS[] PROGMEM = {hal::SERIAL_DIVIDER, 7, 3, 1};
// The last two bytes of an answer are in the transmitter, not in the queue, and take 170 us at 117647 baud.
constexpr uint8_t QUIET_TICKS = 4;

uint8_t in_force, wanted;
uint32_t quiet_since;
bool quiet;

void change() {
  in_force = wanted;
  hal::serial_speed(flash_byte(&DIVIDERS[in_force]));
}

}  // namespace

bool changing() { return wanted != in_force; }

bool raised() { return in_force; }

void reset() {
  wanted = 0;
  change();
}

void service() {
  if (!changing()) return;
  const bool was_quiet = quiet;
  quiet = answers::silent();
  if (!quiet) return;
  if (!was_quiet) quiet_since = board_clock::now();
  if (!board_clock::passed(quiet_since, QUIET_TICKS)) return;
  quiet = false;
  change();
}

}  // namespace baud

namespace handlers {

void set_baud(const int16_t* args, uint8_t) {
  if (answers::can_ask()) baud::wanted = static_cast<uint8_t>(args[0]);
  answers::ask(SET_BAUD, args[0]);
}

}  // namespace handlers
}  // namespace mrl
