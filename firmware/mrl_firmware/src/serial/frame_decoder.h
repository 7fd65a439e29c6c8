// Bytes to requests, one byte at a time.  The twin of FrameDecoder(REQUESTS) in mrl_driver/protocol/decoder.py: same verdicts,
// same reasons, same order.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace mrl {

enum class Verdict : uint8_t { none, frame, garbage };

class FrameDecoder {
 public:
  // Takes one byte; the verdicts `frame` and `garbage` say what it completed.
  Verdict feed(uint8_t byte);
  // Drops the started frame or noise.
  void clear();

  bool in_frame() const { return in_frame_; }
  // Valid after `frame` until the next byte: code, and arguments without the checksum.
  uint8_t code() const { return static_cast<uint8_t>(values_[0]); }
  const int16_t* arguments() const { return values_ + 1; }
  uint8_t count() const { return count_; }
  // Valid after `garbage`.
  Reason reason() const { return reason_; }
  // Length of the frame or garbage that was completed last [byte].
  uint8_t length() const { return completed_; }

  // All requests need a checksum.
  bool checked = false;
  // Those that turn motors need one: the host has turned checksums on, and not off.
  bool asked = false;
  // Before that, a bare `calibrate` needs none.
  bool plain_calibrate = false;

 private:
  Verdict start();
  Verdict skip(uint8_t byte);
  Verdict judge();
  bool needs_check(int16_t code, uint8_t count, uint8_t guarded) const;
  Verdict fit(int16_t code, uint8_t count);
  Verdict garbage(Reason reason);
  void take(uint8_t byte);
  void take_digit(uint8_t digit);
  void begin_token();
  void end_token();
  void refuse(Reason reason);

  int16_t values_[MAX_ARGUMENTS + 1] = {};  // a decoder of zeros alone needs no code at the start
  uint16_t magnitude_ = 0;
  uint16_t crc_ = 0;
  uint16_t crc_at_comma_ = 0;
  uint8_t length_ = 0;
  uint8_t completed_ = 0;
  uint8_t tokens_ = 0;
  uint8_t count_ = 0;
  uint8_t digits_ = 0;
  bool in_frame_ = false;
  bool negative_ = false;
  bool foreign_ = false;
  bool leading_zero_ = false;
  bool overflow_ = false;
  bool refused_ = false;
  Reason reason_ = Reason::noise;
};

}  // namespace mrl
