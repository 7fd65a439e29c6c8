#include "../hal/fast.h"
#include "frame_decoder.h"

#include "crc.h"
#include "../hal/flash.h"

namespace mrl {
namespace {

struct Spec {
  uint8_t least, most, guarded, first_range;
};

constexpr uint8_t NO_REQUEST = 0xFF;
constexpr uint8_t ALWAYS = 1, ONCE_ASKED = 2;  // values of `guarded`

#define SPEC(code, constant, name, there, least, most, guarded, reply, first, ...) {least, most, guarded, first},
#define NO_SPEC(...) {NO_REQUEST, 0, 0, 0},
const Spec SPECS[] PROGMEM = {MRL_COMMANDS(SPEC, SPEC, NO_SPEC)};
static_assert(sizeof SPECS == MAX_CODE * sizeof(Spec), "codes run from 1 without a gap");

struct Range {
  int16_t low, high;
};

#define RANGE(low, high) {low, high},
#define ANY {INT16_MIN, INT16_MAX},
#define RANGES_OF(code, constant, name, there, least, most, guarded, reply, first, ...) __VA_ARGS__
const Range RANGES[] PROGMEM = {MRL_COMMANDS(RANGES_OF, RANGES_OF, RANGES_OF)};

// The row of a request, or nullptr.
const Spec* find(int16_t code) {
  if (code < 1 || code > MAX_CODE) return nullptr;
  const Spec* spec = &SPECS[code - 1];
  return flash_byte(&spec->least) == NO_REQUEST ? nullptr : spec;
}

bool in_ranges(const Spec* spec, const int16_t* args, uint8_t count) {
  const Range* range = &RANGES[flash_byte(&spec->first_range)];
  for (uint8_t i = 0; i < count; i++, range++) {
    if (args[i] < flash_int16(&range->low) || args[i] > flash_int16(&range->high)) return false;
  }
  return true;
}

}  // namespace

Verdict FrameDecoder::feed(uint8_t byte) {
  if (byte == '@') return start();
  if (!in_frame_) return skip(byte);
  length_++;
  if (byte == 'e') return judge();
  if (length_ >= MAX_FRAME) return garbage(Reason::too_long);
  take(byte);
  return Verdict::none;
}

void FrameDecoder::clear() {
  in_frame_ = false;
  length_ = 0;
}

Verdict FrameDecoder::start() {
  Verdict verdict = Verdict::none;
  if (length_) verdict = garbage(in_frame_ ? Reason::restarted : Reason::noise);
  in_frame_ = true;
  length_ = 1;
  tokens_ = 0;
  refused_ = false;
  crc_ = crc_update(CRC_START, '@');
  begin_token();
  return verdict;
}

Verdict FrameDecoder::skip(uint8_t byte) {
  if (byte == '\r' || byte == '\n') return length_ ? garbage(Reason::noise) : Verdict::none;
  length_++;
  return length_ >= MAX_NOISE ? garbage(Reason::noise) : Verdict::none;
}

__attribute__((noinline)) Verdict FrameDecoder::garbage(Reason reason) {
  completed_ = length_;
  clear();
  reason_ = reason;
  return Verdict::garbage;
}

void FrameDecoder::take(uint8_t byte) {
  const uint8_t digit = static_cast<uint8_t>(byte - '0');
  if (byte == ',') {
    end_token();
    begin_token();
    crc_at_comma_ = crc_;
  } else if (digit < 10) {
    take_digit(digit);
  } else if (byte == '-' && !digits_ && !negative_) {
    negative_ = true;
  } else {
    foreign_ = true;
  }
  crc_ = crc_update(crc_, byte);
}

void FrameDecoder::take_digit(uint8_t digit) {
  if (!digits_ && !digit) leading_zero_ = true;
  digits_++;
  if (magnitude_ > 3276 || (magnitude_ == 3276 && digit > 8)) overflow_ = true;
  if (!overflow_) magnitude_ = static_cast<uint16_t>(magnitude_ * 10 + digit);
}

void FrameDecoder::begin_token() {
  magnitude_ = 0;
  digits_ = 0;
  negative_ = foreign_ = leading_zero_ = overflow_ = false;
}

void FrameDecoder::end_token() {
  if (foreign_ || !digits_ || (leading_zero_ && (digits_ > 1 || negative_))) {
    refuse(Reason::not_integer);
  } else if (overflow_ || (magnitude_ > 32767 && !negative_)) {
    refuse(Reason::beyond_int16);
  } else if (tokens_ <= MAX_ARGUMENTS) {
    values_[tokens_] = static_cast<int16_t>(negative_ ? 0u - magnitude_ : magnitude_);
  }
  tokens_++;
}

void FrameDecoder::refuse(Reason reason) {
  if (refused_) return;
  refused_ = true;
  reason_ = reason;
}

Verdict FrameDecoder::judge() {
  end_token();
  if (refused_) return garbage(reason_);
  if (tokens_ > MAX_ARGUMENTS + 1) return garbage(Reason::argument_count);
  return fit(values_[0], static_cast<uint8_t>(tokens_ - 1));
}

bool FrameDecoder::needs_check(int16_t code, uint8_t count, uint8_t guarded) const {
  if (!count && (code == STOP_CODE || (code == CALIBRATE && plain_calibrate && !asked))) return false;
  return checked || guarded == ALWAYS || (guarded == ONCE_ASKED && asked);
}

Verdict FrameDecoder::fit(int16_t code, uint8_t count) {
  const Spec* spec = find(code);
  if (needs_check(code, count, spec ? flash_byte(&spec->guarded) : static_cast<uint8_t>(0))) {
    if (!count || static_cast<uint16_t>(values_[count]) != crc_at_comma_) return garbage(Reason::bad_check);
    count--;
  }
  if (!spec) return garbage(Reason::unknown_command);
  if (count < flash_byte(&spec->least) || count > flash_byte(&spec->most)) return garbage(Reason::argument_count);
  if (!in_ranges(spec, arguments(), count)) return garbage(Reason::argument_range);
  count_ = count;
  completed_ = length_;
  clear();
  return Verdict::frame;
}

}  // namespace mrl
