#include "../hal/fast.h"
#include "stream.h"

#include "../board/board_clock.h"
#include "frame_writer.h"
#include "protocol.h"

namespace mrl {
namespace {

// Times in eighths of a tick, 8 us, so that each period in ms is whole and the cadence never drifts.
constexpr uint32_t EIGHTHS_PER_MS = 125;
constexpr uint32_t RETRY_AFTER_FAILURE = 5 * EIGHTHS_PER_MS;  // when no period is set

__attribute__((noinline)) uint32_t now() { return board_clock::now() << 3; }

__attribute__((noinline)) int32_t left_until(uint32_t time) { return static_cast<int32_t>(time - now()); }

__attribute__((noinline)) bool reached(uint32_t time) {
  const int32_t left = left_until(time);
  return board_clock::passed(board_clock::now(), left > 0 ? static_cast<uint32_t>(left + 7) / 8 : 0);
}

}  // namespace

void Stream::start(uint8_t code, int16_t period_ms) {
  code_ = code;
  period_ = static_cast<uint32_t>(period_ms) * EIGHTHS_PER_MS;
  next_ = now();
}

void Stream::stop(uint8_t code) {
  if (code_ == code) code_ = 0;
}

void Stream::align(const Stream& other) {
  if (!code_ || !other.code_ || !other.period_) return;
  next_ = other.next_;
  while (left_until(next_) > static_cast<int32_t>(period_)) next_ -= period_;
}

bool Stream::due() const { return code_ && reached(next_); }

bool Stream::late() const { return code_ && reached(next_ + period_ / 2); }

bool Stream::due_within(uint16_t eighths) const { return code_ && period_ && left_until(next_ - eighths) <= 0; }

// A frame that is more than a period late starts a new cadence.
void Stream::sent() {
  next_ = period_ ? next_ + period_ : now();
  if (period_ && reached(next_)) next_ = now() + period_;
}

void Stream::failed() {
  if (period_) return sent();
  next_ = now() + RETRY_AFTER_FAILURE;
}

namespace streams {

Stream main, imu;

void report() { writer::add(main.code() != 0); }

}  // namespace streams

namespace handlers {
namespace {

void start(uint8_t code, const int16_t* args, uint8_t count) {
  streams::main.start(code, count ? args[0] : 0);
  streams::imu.align(streams::main);
}

}  // namespace

void start_stream(const int16_t* args, uint8_t count) { start(READ_ENCODERS_AND_SONARS, args, count); }

void start_omni_stream(const int16_t* args, uint8_t count) { start(START_OMNI_STREAM, args, count); }

void stop_stream(const int16_t*, uint8_t) {
  streams::main.stop(READ_ENCODERS_AND_SONARS);
  streams::main.stop(START_OMNI_STREAM);
}

void start_sensor_stream(const int16_t* args, uint8_t count) { start(START_SENSOR_STREAM, args, count); }
void stop_sensor_stream(const int16_t*, uint8_t) { streams::main.stop(START_SENSOR_STREAM); }

void start_sensor_ldr_stream(const int16_t* args, uint8_t count) { start(START_SENSOR_LDR_STREAM, args, count); }
void stop_sensor_ldr_stream(const int16_t*, uint8_t) { streams::main.stop(START_SENSOR_LDR_STREAM); }

void start_compass_stream(const int16_t* args, uint8_t count) { start(START_COMPASS_STREAM, args, count); }
void stop_compass_stream(const int16_t*, uint8_t) { streams::main.stop(START_COMPASS_STREAM); }

}  // namespace handlers
}  // namespace mrl
