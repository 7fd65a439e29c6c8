#include "wheel_watch.h"

namespace mrl {
namespace {

constexpr uint8_t WRONG_PERIODS = 16;    // 80 ms
constexpr int16_t WRONG_COUNTS = 2;
constexpr uint8_t PATIENCE = 100;        // periods, 0.5 s
constexpr uint8_t ALIVE = 16;            // counts
constexpr int16_t DRIVEN = FULL / 2;
constexpr int16_t AT_FULL = FULL / 16 * 15;
constexpr int16_t PLAY = 2;              // counts within which a wheel has not moved
constexpr uint8_t SILENT_PERIODS = 20;   // 100 ms
constexpr uint8_t BLOCKED_PERIODS = 40;  // 200 ms
constexpr uint16_t EXPECTED_Q8 = 32 << 8;

void add(uint8_t& count, uint8_t most = UINT8_MAX) {
  if (count < most) count++;
}

}  // namespace

__attribute__((noinline)) StopReason WheelWatch::update(const WheelSettings& settings, int8_t direction, int16_t duty, int16_t moved, bool edges,
                              int16_t speed, bool controlled) {
  if (moved) add(seen_, ALIVE);
  if (direction != direction_) note_direction(direction, speed);
  if (!direction) return StopReason::none;
  const int16_t along = static_cast<int16_t>(direction > 0 ? moved : -moved);
  if (controlled && counts_wrong(along)) return StopReason::encoder;
  return check_movement(settings, duty, along, edges, controlled);
}

void WheelWatch::note_direction(int8_t direction, int16_t speed) {
  direction_ = direction;
  settled_ = direction > 0 ? speed >= 0 : speed <= 0;
  patience_ = PATIENCE;
  wrong_periods_ = 0;
  restart();
}

// From the first wrong count on, the sum is wrong for 80 ms.  A count to and fro at an edge does not matter.
bool WheelWatch::counts_wrong(int16_t along) {
  if (!settled_) {
    settled_ = along > 0 || !--patience_;  // a slow wheel has periods without a count
    return false;
  }
  if (!wrong_periods_) {
    if (along >= 0) return false;
    wrong_counts_ = 0;
  }
  wrong_periods_++;
  wrong_counts_ = static_cast<int16_t>(wrong_counts_ - along);
  const bool over = wrong_periods_ > WRONG_PERIODS;
  const bool wrong = over && wrong_counts_ >= WRONG_COUNTS;
  if (over || wrong_counts_ <= 0) wrong_periods_ = 0;
  return wrong;
}

void WheelWatch::restart() {
  driven_ = with_edges_ = at_full_ = 0;
  net_ = 0;
  expected_q8_ = 0;
}

// An open wire of one channel lets the counter go to and fro: edges without movement.  An encoder that has never counted
// is silent.  A wheel that has turned before, and does not at full duty, is blocked.
StopReason WheelWatch::check_movement(const WheelSettings& settings, int16_t duty, int16_t along, bool edges,
                                      bool controlled) {
  net_ = static_cast<int16_t>(net_ + along);
  if (duty < DRIVEN || net_ > PLAY || net_ < -PLAY) {
    restart();
    return StopReason::none;
  }
  add(driven_);
  if (edges) add(with_edges_);
  if (duty >= AT_FULL) add(at_full_);
  if (expected_q8_ < EXPECTED_Q8) {
    const uint32_t expected = static_cast<uint32_t>(settings.full_counts_q8) * static_cast<uint16_t>(duty) >> 14;
    expected_q8_ = static_cast<uint16_t>(expected_q8_ + expected);
  }
  if (driven_ < SILENT_PERIODS || expected_q8_ < EXPECTED_Q8) return StopReason::none;
  const bool silent = with_edges_ > driven_ / 2 || seen_ < ALIVE;
  if (controlled && silent) return StopReason::encoder;
  return at_full_ >= BLOCKED_PERIODS ? StopReason::wheel_blocked : StopReason::none;
}

}  // namespace mrl
