// A byte queue between one producer and one consumer, one of which is an interrupt.
#pragma once
#include <stdint.h>

namespace mrl {

template <uint8_t SIZE>
class Ring {
  static_assert((SIZE & (SIZE - 1)) == 0 && SIZE <= 128, "a power of two whose indices fit a byte");

 public:
  // All SIZE places are used: the indices run through the whole byte.
  uint8_t used() const { return static_cast<uint8_t>(head_ - tail_); }
  uint8_t room() const { return static_cast<uint8_t>(SIZE - used()); }
  // The caller has seen room() or used() first.
  void put(uint8_t byte) {
    const uint8_t head = head_;
    bytes_[head & (SIZE - 1)] = byte;
    head_ = static_cast<uint8_t>(head + 1);
  }
  uint8_t take() {
    const uint8_t tail = tail_;
    const uint8_t byte = bytes_[tail & (SIZE - 1)];
    tail_ = static_cast<uint8_t>(tail + 1);
    return byte;
  }
  // For the consumer.
  void clear() { tail_ = head_; }

 private:
  volatile uint8_t head_ = 0;
  volatile uint8_t tail_ = 0;
  volatile uint8_t bytes_[SIZE] = {};  // a queue of zeros alone needs no code at the start
};

}  // namespace mrl
