// Packets of the XBee's API mode 1: 0x7E, length, data, checksum.
#pragma once
#include <stdint.h>

namespace mrl {
namespace xbee {

constexpr uint8_t DELIMITER = 0x7E;
constexpr uint8_t LONGEST = 96;  // a receive packet has 12 bytes and at most 84 of text

class PacketReader {
 public:
  // Takes one byte; true if it completed a packet with a correct checksum.
  bool feed(uint8_t byte) {
    switch (step_) {
      case Step::delimiter:
        if (byte == DELIMITER) step_ = Step::length_high;
        return false;
      case Step::length_high:
        step_ = byte ? Step::delimiter : Step::length_low;
        return false;
      case Step::length_low:
        size_ = byte;
        at_ = sum_ = 0;
        step_ = byte && byte <= LONGEST ? Step::data : Step::delimiter;
        return false;
      case Step::data:
        data_[at_++] = byte;
        sum_ = static_cast<uint8_t>(sum_ + byte);
        if (at_ == size_) step_ = Step::check;
        return false;
      default:
        step_ = Step::delimiter;
        return static_cast<uint8_t>(sum_ + byte) == 0xFF;
    }
  }
  // Looks for the next delimiter.
  void clear() { step_ = Step::delimiter; }
  bool in_packet() const { return step_ != Step::delimiter; }
  // Valid after feed() returned true, until the next byte.
  const uint8_t* data() const { return data_; }
  uint8_t size() const { return size_; }

 private:
  enum class Step : uint8_t { delimiter, length_high, length_low, data, check };

  Step step_ = Step::delimiter;
  uint8_t size_ = 0;
  uint8_t at_ = 0;
  uint8_t sum_ = 0;
  uint8_t data_[LONGEST];
};

}  // namespace xbee
}  // namespace mrl
