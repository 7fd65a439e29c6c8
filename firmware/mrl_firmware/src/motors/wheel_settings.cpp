#include "wheel_settings.h"

#include "../board/config.h"
#include "../serial/protocol.h"

namespace mrl {
namespace {

static_assert(PERIOD_TICKS == 78, "the numbers below are for periods of 4.992 ms");

constexpr uint32_t MOST_COUNTS = 34000000;   // 0.01 count a wheel turn; beyond it the products overflow
constexpr uint32_t FEWEST_Q8 = 64, MOST_Q8 = 32767;

// full speed [1/min] * counts [0.01 / turn] / 8 / COUNTS = counts a period * 256: 6000 / (4.992 ms * 256 * 8)
constexpr uint32_t COUNTS = 587;
// FULL * PERIOD_TICKS * 256
constexpr uint32_t PER_COUNT_TICK = 327155712;
// FULL * 4.992 ms / 200 ms * 256 * 256
constexpr uint32_t PER_COUNT = 26800596;
// FULL * 256 * 6000 / (2 pi): mm/s at full speed [1/min], wheel radius [0.01 mm]
constexpr uint32_t PER_MM_S = 4005265287;
// FULL * 256 * 4.992 ms
constexpr uint32_t RAMP = 20937966;

__attribute__((noinline)) uint32_t number(Parameter parameter) { return static_cast<uint16_t>(config::get(parameter)); }

// A product with a constant, whose low 16 bits are dropped, rounded.
__attribute__((noinline)) uint16_t times(Parameter parameter, uint32_t factor_q16) {
  return static_cast<uint16_t>((number(parameter) * factor_q16 + 32768) >> 16);
}

}  // namespace

bool WheelSettings::configure() {
  const uint32_t full_speed = number(Parameter::full_speed), wheel = full_speed * number(Parameter::wheel_radius);
  const uint32_t counts = number(Parameter::gearbox) * number(Parameter::encoder_counts);
  if (counts > MOST_COUNTS) return false;
  const uint32_t full_q8 = (counts / 8 * full_speed + COUNTS / 2) / COUNTS;
  const uint32_t per_mm_s = PER_MM_S / wheel;
  if (full_q8 < FEWEST_Q8 || full_q8 > MOST_Q8 || per_mm_s > UINT16_MAX) return false;
  const uint32_t per_mrad_s = per_mm_s * number(Parameter::axis_radius) / 6250;  // / 100000 * 16
  if (per_mrad_s > UINT16_MAX) return false;

  full_counts_q8 = static_cast<uint16_t>(full_q8);
  share_per_count_tick = PER_COUNT_TICK / full_q8;
  share_per_count_q8 = PER_COUNT / full_q8;
  share_per_mm_s_q8 = static_cast<uint16_t>(per_mm_s);
  share_per_mrad_s_q12 = static_cast<uint16_t>(per_mrad_s);

  const uint32_t ramp_ms = number(Parameter::ramp_time);
  ramp_q8 = static_cast<int32_t>(ramp_ms ? RAMP / ramp_ms : static_cast<uint32_t>(FULL) << 8);
  friction = static_cast<int16_t>(times(Parameter::friction_duty, 1073742));  // 16.384
  kp_q10 = times(Parameter::kp, 67109);                                       // 1.024
  ki_q16 = times(Parameter::ki, 21440);                                       // 65.536 * 4.992 ms
  const uint16_t feed_forward = static_cast<uint16_t>((FULL - friction) / 16);
  target_gain_q10 = kp_q10 > feed_forward ? kp_q10 : feed_forward;
  pause_periods = static_cast<uint8_t>(times(Parameter::reversal_pause, 13128));  // 1 / 4.992 ms
  if (number(Parameter::no_encoders)) {
    full_counts_q8 = kp_q10 = ki_q16 = 0;
    target_gain_q10 = feed_forward;
  }
  return true;
}

}  // namespace mrl
