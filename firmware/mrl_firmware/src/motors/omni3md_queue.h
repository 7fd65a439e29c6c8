// Commands that wait for the motor board, oldest first.
#pragma once
#include "omni3md_message.h"

namespace mrl {
namespace motor {

class Queue {
 public:
  bool empty() const { return !count_; }
  const Message& front() const { return messages_[first_]; }
  void pop() {
    first_ = static_cast<uint8_t>((first_ + 1) % SIZE);
    count_--;
  }
  // Returns false if the newest waiting command was dropped to make room.
  bool push(const Message& message) {
    const bool room = count_ < SIZE;
    if (room) count_++;
    messages_[(first_ + count_ - 1) % SIZE] = message;
    return room;
  }
  // Drops commands that would turn the motors; the rest keeps its order.
  void drop_moves() {
    for (uint8_t left = count_; left; left--) {
      const Message message = front();
      pop();
      if (!message.turns_motors()) push(message);
    }
  }
  uint8_t clear() {
    const uint8_t dropped = count_;
    count_ = 0;
    return dropped;
  }

 private:
  static constexpr uint8_t SIZE = 8;  // a power of two: the remainders cost nothing
  Message messages_[SIZE];
  uint8_t first_ = 0;
  uint8_t count_ = 0;
};

}  // namespace motor
}  // namespace mrl
