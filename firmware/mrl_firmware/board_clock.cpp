#include "board_clock.h"

#include "hal.h"

namespace mrl {
namespace board_clock {
namespace {

constexpr uint16_t TICKS_PER_SECOND = 15625;

uint32_t now_ticks;
uint32_t seconds;
uint32_t part_of_second;

}  // namespace

void begin() {
  now_ticks = hal::ticks();
  seconds = 0;
  part_of_second = 0;
}

uint16_t update() {
  const uint16_t delta = static_cast<uint16_t>(hal::ticks() - static_cast<uint16_t>(now_ticks));
  now_ticks += delta;
  part_of_second += delta;
  while (part_of_second >= TICKS_PER_SECOND) {
    part_of_second -= TICKS_PER_SECOND;
    seconds++;
  }
  return delta;
}

uint32_t now() { return now_ticks; }

uint32_t uptime_s() { return seconds; }

}  // namespace board_clock
}  // namespace mrl
