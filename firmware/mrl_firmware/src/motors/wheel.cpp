#include "../hal/fast.h"
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

__attribute__((noinline)) int32_t within(int32_t value, int32_t most) {
  return value > most ? most : value < -most ? -most : value;
}

// A gain and a share; the product has up to 31 bits.
int32_t product(uint16_t gain, int16_t share) { return static_cast<int32_t>(gain) * share; }

__attribute__((noinline)) int32_t product_q10(uint16_t gain, int16_t share) { return product(gain, share) >> 10; }

}  // namespace

__attribute__((noinline)) void Wheel::set(Mode mode, int16_t target) {
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

bool Wheel::turns(bool backward) const {
  if (mode_ == Mode::position) return true;
  if (setpoint_q8_ && (direction_ < 0) == backward) return true;
  return target_ && (target_ < 0) == backward;
}

// Not merged into the loop, where the compiler would compute the wheel's address for each member.
__attribute__((noinline)) StopReason Wheel::measure(const WheelSettings& settings, int16_t moved, uint16_t edge_tick, uint16_t tick) {
  const bool edges = edge_tick != edge_tick_;
  edge_tick_ = edge_tick;
  travel_ = static_cast<int32_t>(static_cast<uint32_t>(travel_) + static_cast<uint32_t>(moved));  // wraps
  estimate_.update(settings, static_cast<uint16_t>(travel_), edge_tick, tick);
  return watch_.update(settings, direction_, duty_, moved, edges, estimate_.speed(), mode_ != Mode::duty);
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
__attribute__((noinline)) void Wheel::ramp(const WheelSettings& settings) {
  const int16_t target = mode_ == Mode::position ? approach(settings) : target_;
  const int8_t wanted = target < 0 ? -1 : 1;  // a target of 0 ends at rest from either
  if (pause_) pause_--;
  if (!direction_ && pause_ && wanted != last_direction()) return come_to_rest(settings);
  const bool turn_back = direction_ && wanted != direction_;
  const int32_t goal = turn_back ? 0 : size(target) << 8;
  const int32_t change = goal - setpoint_q8_;
  const bool at_once = mode_ == Mode::position && change < 0;
  setpoint_q8_ += at_once ? change : within(change, settings.ramp_q8);
  if (!setpoint_q8_) return come_to_rest(settings);
  if (direction_) return;
  direction_ = wanted;
  backward_ = wanted < 0;
  driven_ = true;
}

void Wheel::come_to_rest(const WheelSettings& settings) {
  if (driven_) pause_ = settings.pause_periods;
  driven_ = false;
  direction_ = 0;
  integral_q16_ = 0;
}

// duty = friction + target_gain * setpoint - kp * speed + integral, never against the setpoint.  The integral stands still
// while the error drives the duty further beyond its limits.
__attribute__((noinline)) void Wheel::control(const WheelSettings& settings) {
  const int16_t setpoint = static_cast<int16_t>(setpoint_q8_ >> 8);
  const bool driven = direction_ && setpoint_q8_;
  if (!driven || mode_ == Mode::duty) {
    duty_ = driven ? setpoint : static_cast<int16_t>(0);
    return;
  }
  const int16_t speed = static_cast<int16_t>(direction_ > 0 ? estimate_.speed() : -estimate_.speed());
  const int32_t wanted = settings.friction + product_q10(settings.target_gain_q10, setpoint) -
                         product_q10(settings.kp_q10, speed) + (integral_q16_ >> 16);
  duty_ = limit(wanted, 0, FULL);
  const int16_t error = static_cast<int16_t>(within(static_cast<int32_t>(setpoint) - speed, INT16_MAX));
  const bool beyond = wanted != duty_;
  if (beyond && (wanted > FULL) == (error > 0)) return;
  integral_q16_ = within(integral_q16_ + product(settings.ki_q16, error), INTEGRAL_MOST);
}

// What is lost by the eight bits of the output is added in the next period.
uint8_t Wheel::level() {
  if (!duty_) return 0;
  const uint32_t sum = static_cast<uint32_t>(duty_) * 255 + carry_;
  carry_ = static_cast<uint16_t>(sum & (FULL - 1));
  return static_cast<uint8_t>(sum << 2 >> 16);
}

}  // namespace mrl
