// The board's clock: 64 us ticks, extended to 32 bits (76 hours) by the loop.  Differences survive the wrap.
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
inline bool passed(uint32_t since, uint32_t ticks) { return now() - since >= ticks; }
// Whole seconds since begin().
uint32_t uptime_s();

}  // namespace board_clock
}  // namespace mrl
