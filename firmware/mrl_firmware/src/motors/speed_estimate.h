// The speed of a wheel out of its encoder's counts and the times of their last edges.
//
// The speed is counts by time between the last edges of two samples.  At low speed these are single edges, whose times
// are exact to a tick.  At high speed many edges lie between them, and the speed is that of the counts.  At least four
// edges lie between, a whole cycle of both channels, because the edges within a cycle are not evenly spaced.
#pragma once
#include <stdint.h>

#include "wheel_settings.h"

namespace mrl {

class SpeedEstimate {
 public:
  // One sample: the counter, the tick of its last edge, the tick of the sample.
  void update(const WheelSettings& settings, uint16_t count, uint16_t edge_tick, uint16_t tick);
  // Signed share of full speed, at most 2 * FULL - 1.
  int16_t speed() const { return speed_; }

 private:
  static constexpr uint8_t MARKS = 5;
  struct Mark {
    uint16_t count, tick;
  };

  void rest(uint16_t count, uint16_t tick);
  void measure(const WheelSettings& settings);
  void fade(const WheelSettings& settings, uint16_t waited);
  void set_speed(uint16_t magnitude);

  Mark marks_[MARKS] = {};  // newest first: samples in which the counter had changed
  uint8_t used_ = 0;
  uint8_t quiet_ = 0;       // samples since the last change
  uint16_t counts_ = 0, ticks_ = 0;  // what the speed was computed from
  bool backward_ = false;
  int16_t speed_ = 0;
};

}  // namespace mrl
