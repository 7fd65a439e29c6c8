// The board's clock: 64 us ticks, extended to 32 bits (76 hours) by the loop.  Differences survive the wrap.
// The clock is also the alarm: a task that asks whether a time has passed, before it has, is called again at that time.
#pragma once
#include <stdint.h>

namespace mrl {
namespace board_clock {

// 1 ms is 15.625 ticks; exact for multiples of 8 ms, rounded down otherwise.  At most 34 s.
constexpr uint32_t of_ms(uint32_t ms) { return ms * 125 / 8; }

// Starts at the hardware's count.
void begin();
// Takes the hardware's count, once a pass; the ticks since the last call (unambiguous up to 4.19 s).
uint16_t update();
// Time of the last update().
uint32_t now();
// Whether this time has passed since then.  If not, the loop sleeps no longer than until it has.
bool passed(const uint32_t& since, uint32_t ticks);
// For a task that has more to do: the loop makes another pass before it sleeps.
void stay_awake();
// The tick until which the loop may sleep after this pass; the present one if a time had passed, or a task is not done.
uint16_t alarm();
// Whole seconds since begin().
uint32_t uptime_s();

}  // namespace board_clock
}  // namespace mrl
