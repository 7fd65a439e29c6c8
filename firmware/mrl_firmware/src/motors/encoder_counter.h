// A counter of the protocol: a wheel's counts from a preset value on, divided by its prescaler.
#pragma once
#include <stdint.h>

namespace mrl {

// `travel` is the sum of all counts of the wheel, which wraps.
class EncoderCounter {
 public:
  // Rounds down.
  __attribute__((noinline)) int16_t read(int32_t travel) const {
    const int32_t moved = static_cast<int32_t>(static_cast<uint32_t>(travel) - static_cast<uint32_t>(travel_));
    if (!divided_) return static_cast<int16_t>(static_cast<uint16_t>(count_) + static_cast<uint16_t>(moved));
    const int32_t steps = (moved < 0 ? moved - prescale_ + 1 : moved) / prescale_;
    return static_cast<int16_t>(count_ + steps);
  }
  // The counter is `count` from now on.
  void preset(int16_t count, int32_t travel) {
    count_ = count;
    travel_ = travel;
  }
  // A counter step takes 10^`power` counts; the counter stays.
  void set_prescaler(uint8_t power, int32_t travel) {
    preset(read(travel), travel);
    divided_ = power;
    for (prescale_ = 1; power; power--) prescale_ *= 10;
  }
  // The travel at which the counter is `count`, the shorter way round.
  int32_t travel_at(int16_t count, int32_t travel) const {
    const int32_t way = static_cast<int16_t>(count - read(travel)) * prescale_;
    return static_cast<int32_t>(static_cast<uint32_t>(travel) + static_cast<uint32_t>(way));
  }

 private:
  int16_t count_ = 0;
  int32_t travel_ = 0;
  int32_t prescale_ = 1;
  bool divided_ = false;  // spares the chip a division by 1
};

}  // namespace mrl
