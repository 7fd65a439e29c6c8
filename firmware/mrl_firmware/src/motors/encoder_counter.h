// A counter of the protocol: a wheel's counts from a preset value on, divided by its prescaler.
#pragma once
#include <stdint.h>

namespace mrl {

class EncoderCounter {
 public:
  // `travel` is the sum of all counts of the wheel.
  int16_t read(int32_t travel) const;
  // The counter is `count` from now on.
  void preset(int16_t count, int32_t travel);
  // A counter step takes 10^`power` counts; the counter stays.
  void set_prescaler(uint8_t power, int32_t travel);
  // The travel at which the counter is `count`, the shorter way round.
  int32_t travel_at(int16_t count, int32_t travel) const;

 private:
  int16_t count_ = 0;
  int32_t travel_ = 0;
  int32_t prescale_ = 1;
  bool divided_ = false;  // spares the chip a division by 1
};

}  // namespace mrl
