#include "encoder_counter.h"

namespace mrl {
namespace {

// Travels wrap.
int32_t sum(int32_t a, int32_t b) { return static_cast<int32_t>(static_cast<uint32_t>(a) + static_cast<uint32_t>(b)); }
int32_t difference(int32_t a, int32_t b) {
  return static_cast<int32_t>(static_cast<uint32_t>(a) - static_cast<uint32_t>(b));
}

}  // namespace

// Rounds down.
__attribute__((noinline)) int16_t EncoderCounter::read(int32_t travel) const {
  const int32_t moved = difference(travel, travel_);
  if (!divided_) return static_cast<int16_t>(sum(count_, moved));
  const int32_t steps = (moved < 0 ? moved - prescale_ + 1 : moved) / prescale_;
  return static_cast<int16_t>(count_ + steps);
}

void EncoderCounter::preset(int16_t count, int32_t travel) {
  count_ = count;
  travel_ = travel;
}

void EncoderCounter::set_prescaler(uint8_t power, int32_t travel) {
  preset(read(travel), travel);
  divided_ = power;
  for (prescale_ = 1; power; power--) prescale_ *= 10;
}

int32_t EncoderCounter::travel_at(int16_t count, int32_t travel) const {
  return sum(travel, static_cast<int16_t>(count - read(travel)) * prescale_);
}

}  // namespace mrl
