#include "encoder_counter.h"

namespace mrl {

// Rounds down.
__attribute__((noinline)) int16_t EncoderCounter::read(int32_t travel) const {
  const int32_t moved = travel - travel_;
  if (prescale_ == 1) return static_cast<int16_t>(count_ + moved);
  const int32_t steps = (moved < 0 ? moved - prescale_ + 1 : moved) / prescale_;
  return static_cast<int16_t>(count_ + steps);
}

void EncoderCounter::preset(int16_t count, int32_t travel) {
  count_ = count;
  travel_ = travel;
}

void EncoderCounter::set_prescaler(uint8_t power, int32_t travel) {
  preset(read(travel), travel);
  for (prescale_ = 1; power; power--) prescale_ *= 10;
}

int32_t EncoderCounter::travel_at(int16_t count, int32_t travel) const {
  return travel + static_cast<int16_t>(count - read(travel)) * prescale_;
}

}  // namespace mrl
