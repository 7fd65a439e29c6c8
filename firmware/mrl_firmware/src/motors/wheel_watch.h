// Finds a wheel that does not turn, and an encoder that is silent or counts in the wrong direction.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"
#include "wheel_settings.h"

namespace mrl {

class WheelWatch {
 public:
  // One period: the direction of the drive (0: none) and its duty, the counts in it, whether the encoder had edges at
  // all, and the measured speed.  Returns why the motors must stop, or `none`.  `controlled`: the speed is controlled,
  // so that wrong counts would make the wheel race; a percentage of the duty turns a wheel whatever its encoder counts.
  StopReason update(const WheelSettings& settings, int8_t direction, int16_t duty, int16_t moved, bool edges,
                    int16_t speed, bool controlled);

 private:
  void note_direction(int8_t direction, int16_t speed);
  bool counts_wrong(int16_t along);
  void restart();
  StopReason check_movement(const WheelSettings& settings, int16_t duty, int16_t along, bool edges, bool controlled);

  int8_t direction_ = 0;
  bool settled_ = false;    // since the drive changed its direction, the wheel has stopped turning in the old one
  uint8_t patience_ = 0;    // periods until it counts as settled in any case
  uint8_t wrong_periods_ = 0;
  int16_t wrong_counts_ = 0;

  uint8_t seen_ = 0;  // counts since power-up, up to ALIVE
  uint8_t driven_ = 0, with_edges_ = 0, at_full_ = 0;  // periods without movement at half of full duty or more
  int16_t net_ = 0;
  uint16_t expected_q8_ = 0;  // counts of a wheel that turns freely
};

}  // namespace mrl
