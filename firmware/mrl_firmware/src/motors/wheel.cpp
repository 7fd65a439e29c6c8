#include "wheel.h"

namespace mrl {
namespace {

constexpr int32_t REACHED = 2;      // counts: a positional move is at its end
constexpr int32_t FAR = 5000;       // counts: more would overflow
constexpr int16_t SLOWEST = FULL / 64;  // of a positional move, near its end
constexpr int32_t INTEGRAL_MOST = static_cast<int32_t>(FULL) << 16;

int32_t size(int32_t value) { return value < 0 ? -value : value; }

int16_t limit(int32_t value, int16_t least, int16_t most) {
  return static_cast<int16_t>(value < least ? least : value > most ? most : value);
}

// A gain and a share; the product has up to 31 bits.
int32_t product(uint16_t gain, int16_t share) { return static_cast<int32_t>(gain) * share; }

}  // namespace

void Wheel::set(Mode mode, int16_t target) {
  if (mode != mode_) integral_q16_ = 0;
  mode_ = mode;
  target_ = target;
}

void Wheel::go_to(int32_t travel, int16_t speed) {
  go_to_ = travel;
  set(Mode::position, static_cast<int16_t>(size(speed)));
}

void Wheel::stop() {
  set(Mode::speed, 0);
  setpoint_q8_ = 0;
  integral_q16_ = 0;
  duty_ = 0;
}

// Not merged into the loop, where the compiler would compute the wheel's address for each member.
__attribute__((noinline)) StopReason Wheel::update(const WheelSettings& settings, int16_t moved, uint16_t edge_tick, uint16_t tick) {
  const bool edges = edge_tick != edge_tick_;
  edge_tick_ = edge_tick;
  travel_ = static_cast<int32_t>(static_cast<uint32_t>(travel_) + static_cast<uint32_t>(moved));  // wraps
  estimate_.update(settings, static_cast<uint16_t>(travel_), edge_tick, tick);
  const StopReason reason =
      watch_.update(settings, direction_, duty_, moved, edges, estimate_.speed(), mode_ != Mode::duty);
  ramp(settings, mode_ == Mode::position ? approach(settings) : target_);
  control(settings);
  return reason;
}

// The speed falls with the way that is left, by a factor of e in 200 ms.
int16_t Wheel::approach(const WheelSettings& settings) const {
  const int32_t left = go_to_ - travel_, way = size(left);
  if (way <= REACHED) return 0;
  const int32_t counts = way < FAR ? way : FAR;
  const int32_t speed = static_cast<int32_t>(settings.share_per_count_q8 * static_cast<uint32_t>(counts) >> 8);
  const int16_t most = limit(speed, SLOWEST, FULL);
  const int16_t magnitude = most < target_ ? most : target_;
  return left < 0 ? static_cast<int16_t>(-magnitude) : magnitude;
}

// Moves the setpoint by at most the ramp.  A reversal passes through zero, rests there, and goes on in another period.
void Wheel::ramp(const WheelSettings& settings, int16_t target) {
  const int8_t wanted = target < 0 ? -1 : 1;  // a target of 0 ends at rest from either
  if (pause_) pause_--;
  if (!direction_ && pause_ && wanted != last_direction_) return come_to_rest(settings);
  const bool turn_back = direction_ && wanted != direction_;
  const uint32_t goal = turn_back ? 0 : static_cast<uint32_t>(size(target)) << 8;
  const bool at_once = mode_ == Mode::position && goal < setpoint_q8_;
  const uint32_t step = at_once ? setpoint_q8_ : settings.ramp_q8;
  if (setpoint_q8_ < goal) {
    setpoint_q8_ = goal - setpoint_q8_ > step ? setpoint_q8_ + step : goal;
  } else {
    setpoint_q8_ = setpoint_q8_ - goal > step ? setpoint_q8_ - step : goal;
  }
  if (!setpoint_q8_) return come_to_rest(settings);
  if (direction_) return;
  direction_ = last_direction_ = wanted;
  paused_ = false;
}

void Wheel::come_to_rest(const WheelSettings& settings) {
  if (!paused_) pause_ = settings.pause_periods;
  paused_ = true;
  direction_ = 0;
  integral_q16_ = 0;
}

// duty = friction + target_gain * setpoint - kp * speed + integral, never against the setpoint.  The integral stands still
// while the error drives the duty further beyond its limits.
void Wheel::control(const WheelSettings& settings) {
  const int16_t setpoint = static_cast<int16_t>(setpoint_q8_ >> 8);
  if (!direction_ || mode_ == Mode::duty) {
    duty_ = direction_ ? setpoint : static_cast<int16_t>(0);
    return;
  }
  const int16_t speed = static_cast<int16_t>(direction_ > 0 ? estimate_.speed() : -estimate_.speed());
  const int32_t wanted = settings.friction + (product(settings.target_gain_q10, setpoint) >> 10) -
                         (product(settings.kp_q10, speed) >> 10) + (integral_q16_ >> 16);
  duty_ = limit(wanted, 0, FULL);
  const int16_t error = limit(static_cast<int32_t>(setpoint) - speed, -INT16_MAX, INT16_MAX);
  const bool beyond = wanted != duty_;
  if (beyond && (wanted > FULL) == (error > 0)) return;
  integral_q16_ += product(settings.ki_q16, error);
  if (integral_q16_ > INTEGRAL_MOST) integral_q16_ = INTEGRAL_MOST;
  if (integral_q16_ < -INTEGRAL_MOST) integral_q16_ = -INTEGRAL_MOST;
}

// What is lost by the eight bits of the output is added in the next period.
int16_t Wheel::level() {
  if (!duty_) return 0;
  const uint32_t sum = static_cast<uint32_t>(duty_) * 255 + carry_;
  carry_ = static_cast<uint16_t>(sum & (FULL - 1));
  const int16_t level = static_cast<int16_t>(sum >> 14);
  return static_cast<int16_t>(direction_ > 0 ? level : -level);
}

}  // namespace mrl
