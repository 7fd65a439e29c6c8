// Messages to the OMNI-3MD motor board: a command byte, then data; 16-bit values have their high byte first.
#pragma once
#include <stdint.h>

namespace mrl {
namespace motor {

enum Command : uint8_t {
  READ_VERSION = 0xFE,
  READ_VERSION_DECIMALS = 0xFD,
  STOP_MOTORS = 0xFC,
  CALIBRATE_MOTORS = 0xFB,
  MOVE_OMNI = 0xFA,
  MOVE_PID = 0xF8,
  MOVE_PLAIN = 0xF7,
  GAINS = 0xF4,
  TIMEOUT = 0xF1,
  PRESCALER = 0xF0,
  PRESET = 0xEF,
  MOVE_POSITION = 0xEE,
  RAMP = 0xEC,
  MOVE_SI = 0xEB,
  GEOMETRY = 0xEA,
  READ_ENCODERS_FROM_1 = 0xD8,
  READ_BATTERY = 0xD5,
  READ_TEMPERATURE = 0xD4,
};

constexpr uint8_t KEY_1 = 0xAA, KEY_2 = 0x55;

// One write; `pause_ms` is how long the board's EEPROM keeps it busy afterwards.
struct Message {
  uint8_t size;
  uint8_t pause_ms;
  uint8_t bytes[9];

  explicit Message(uint8_t command = 0, uint8_t pause = 0) : size(1), pause_ms(pause) { bytes[0] = command; }
  Message& byte(uint8_t value) {
    bytes[size++] = value;
    return *this;
  }
  Message& word(int16_t value) {
    const uint16_t bits = static_cast<uint16_t>(value);
    return byte(static_cast<uint8_t>(bits >> 8)).byte(static_cast<uint8_t>(bits));
  }
  Message& keys() { return byte(KEY_1).byte(KEY_2); }

  bool turns_motors() const {
    const uint8_t command = bytes[0];
    return command == MOVE_SI || command == MOVE_PID || command == MOVE_PLAIN || command == MOVE_POSITION ||
           command == MOVE_OMNI || command == CALIBRATE_MOTORS;
  }
};

// Messages that wait for the motor board, oldest first.
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
