#include "xbee_packet.h"

namespace mrl {
namespace xbee {

bool PacketReader::feed(uint8_t byte) {
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

}  // namespace xbee
}  // namespace mrl
