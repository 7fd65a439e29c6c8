#include "../hal/fast.h"
#include "speed_estimate.h"

namespace mrl {
namespace {

constexpr uint8_t CYCLE = 4;          // edges of both channels
constexpr uint16_t LEAST_TICKS = 120;  // 7.7 ms: two samples at high speed
constexpr uint16_t MOST_COUNTS = 400;  // in a measurement; more would overflow
constexpr uint8_t STANDING = 200;      // samples, 1 s; the ticks of five marks then still fit into 16 bits

// n / d, at most 65535.  The compiler's division of 32 bits takes 38 us on the chip, this one 15 us.
__attribute__((noinline)) uint16_t quotient(uint32_t n, uint16_t d) {
  uint16_t high = static_cast<uint16_t>(n >> 16), low = static_cast<uint16_t>(n);
  if (high >= d) return UINT16_MAX;
  for (uint8_t bits = 16; bits; bits--) {
    const bool carry = high & 0x8000;
    high = static_cast<uint16_t>(high << 1);
    if (low & 0x8000) high |= 1;
    low = static_cast<uint16_t>(low << 1);
    if (carry || high >= d) {
      high = static_cast<uint16_t>(high - d);
      low |= 1;
    }
  }
  return low;
}

}  // namespace

__attribute__((noinline)) void SpeedEstimate::update(const WheelSettings& settings, uint16_t count, uint16_t edge_tick, uint16_t tick) {
  if (!used_) return rest(count, tick);
  if (count == marks_[0].count) {
    if (quiet_ < STANDING) quiet_++;
    if (quiet_ == STANDING) return rest(count, tick);
    return fade(settings, static_cast<uint16_t>(tick - marks_[0].tick));
  }
  quiet_ = 0;
  for (uint8_t i = MARKS - 1; i; i--) marks_[i] = marks_[i - 1];
  marks_[0] = {count, edge_tick};
  if (used_ < MARKS) used_++;
  measure(settings);
}

// The next edge is measured from the last sample without one.
void SpeedEstimate::rest(uint16_t count, uint16_t tick) {
  marks_[0] = {count, tick};
  used_ = 1;
  quiet_ = STANDING;
  speed_ = 0;
}

void SpeedEstimate::measure(const WheelSettings& settings) {
  int16_t counts = 0;
  for (uint8_t i = 1; i < used_; i++) {
    counts = static_cast<int16_t>(marks_[0].count - marks_[i].count);
    ticks_ = static_cast<uint16_t>(marks_[0].tick - marks_[i].tick);
    if ((counts >= CYCLE || counts <= -CYCLE) && ticks_ >= LEAST_TICKS) break;
  }
  backward_ = counts < 0;
  counts_ = static_cast<uint16_t>(backward_ ? -counts : counts);
  if (counts_ > MOST_COUNTS) counts_ = MOST_COUNTS;
  if (ticks_ < PERIOD_TICKS) ticks_ = PERIOD_TICKS;  // the first edges after a rest: less is not known
  set_speed(quotient(settings.share_per_count_tick * counts_, ticks_));
}

// Without an edge for 1.5 times as long as expected, the wheel is slower than it was: at most 1.5 counts in this time.
void SpeedEstimate::fade(const WheelSettings& settings, uint16_t waited) {
  if (2 * static_cast<uint32_t>(waited) * counts_ > 3 * static_cast<uint32_t>(ticks_)) {
    set_speed(quotient(settings.share_per_count_tick * 3 / 2, waited));
  }
}

void SpeedEstimate::set_speed(uint16_t magnitude) {
  const int16_t most = magnitude < INT16_MAX ? static_cast<int16_t>(magnitude) : INT16_MAX;
  speed_ = static_cast<int16_t>(backward_ ? -most : most);
}

}  // namespace mrl
