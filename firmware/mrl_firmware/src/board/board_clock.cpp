#include "../hal/fast.h"
#include "board_clock.h"

#include "../hal/hal.h"

namespace mrl {
namespace board_clock {
namespace {

constexpr uint16_t TICKS_PER_SECOND = 15625;
constexpr uint16_t LONGEST_SLEEP = of_ms(64);  // half the time after which the chip's watchdog wants to be kicked

uint32_t now_ticks;
uint32_t seconds;
uint32_t part_of_second;
uint16_t may_sleep;  // [tick]

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
  may_sleep = LONGEST_SLEEP;
  return delta;
}

uint32_t now() { return now_ticks; }

// A time that has passed changes what the tasks do, so that they are all asked once more.
bool passed(const uint32_t& since, uint32_t ticks) {
  const uint32_t gone = now_ticks - since;
  if (gone >= ticks) {
    may_sleep = 0;
    return true;
  }
  const uint32_t left = ticks - gone;
  if (left < may_sleep) may_sleep = static_cast<uint16_t>(left);
  return false;
}

void stay_awake() { may_sleep = 0; }

uint16_t alarm() { return static_cast<uint16_t>(now_ticks + may_sleep); }

uint32_t uptime_s() { return seconds; }

}  // namespace board_clock
}  // namespace mrl
