// What the parameters mean to the control of a wheel, in fixed point, computed once when a parameter changes.
//
// Speeds and duties are shares: FULL is the full speed of parameter 18, or a duty of 100 %.  A period is the time between
// two samples of the encoders.  A name that ends in qN is scaled by 2^N.
#pragma once
#include <stdint.h>

#include "../hal/hal.h"

namespace mrl {

constexpr int16_t FULL = 16384;
constexpr uint16_t PERIOD_TICKS = hal::SAMPLE_TICKS;

struct WheelSettings {
  uint16_t full_counts_q8;       // counts a period at full speed; 0 without encoders, and then no wheel is watched
  uint32_t share_per_count_tick;  // speed = counts * this / ticks
  uint32_t share_per_count_q8;   // of a positional move: speed for each count that is left, 1 / (200 ms)
  uint16_t share_per_mm_s_q8;
  uint16_t share_per_mrad_s_q12;
  int32_t ramp_q8;           // largest change of the setpoint in a period
  uint16_t kp_q10;           // duty for each share of error
  uint16_t target_gain_q10;  // duty for each share of the setpoint: kp, but at least the feed-forward
  uint16_t ki_q16;           // duty for each share of error in a period
  int16_t friction;          // duty at which a wheel begins to turn
  uint8_t pause_periods;     // of a reversal at zero

  // Takes the configuration; false if its numbers cannot be controlled: fewer than 50 or more than 25000 counts/s at full
  // speed, or a full speed below 64 mm/s.
  bool configure();
};

}  // namespace mrl
