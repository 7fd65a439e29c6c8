#include "../hal/fast.h"
#include "stream.h"

#include "../board/board_clock.h"
#include "frame_writer.h"
#include "protocol.h"

namespace mrl {
namespace {

// Times in eighths of a tick, 8 us, so that each period in ms is whole and the cadence never drifts.  Each pass of the loop
// asks whether a frame is due, which is a comparison of ticks alone.
constexpr uint32_t EIGHTHS_PER_MS = 125;
constexpr uint32_t RETRY_AFTER_FAILURE = 5 * EIGHTHS_PER_MS;  // when no period is set

__attribute__((noinline)) uint32_t now() { return board_clock::now() << 3; }

__attribute__((noinline)) int32_t left_until(uint32_t time) { return static_cast<int32_t>(time - now()); }

int32_t ticks_until(uint32_t tick) { return static_cast<int32_t>(tick - board_clock::now()); }

__attribute__((noinline)) bool reached(uint32_t tick) {
  const int32_t left = ticks_until(tick);
  return board_clock::passed(board_clock::now(), left > 0 ? static_cast<uint32_t>(left) : 0);
}

}  // namespace

__attribute__((noinline)) void Stream::plan(uint32_t next) {
  next_ = next;
  due_ = board_clock::now() + static_cast<uint32_t>((left_until(next) + 7) >> 3);
}

__attribute__((noinline)) void Stream::start(uint8_t code, int16_t period_ms) {
  code_ = code;
  period_ = static_cast<uint32_t>(period_ms) * EIGHTHS_PER_MS;
  plan(now());
}

void Stream::stop(uint8_t code) {
  if (code_ == code) code_ = 0;
}

__attribute__((noinline)) void Stream::align(const Stream& other) {
  if (!code_ || !other.code_ || !other.period_) return;
  uint32_t next = other.next_;
  while (left_until(next) > static_cast<int32_t>(period_)) next -= period_;
  plan(next);
}

bool Stream::due() const { return code_ && reached(due_); }

bool Stream::late() const { return code_ && reached(due_ + period_ / 16); }

bool Stream::due_within(uint8_t ticks) const { return code_ && period_ && ticks_until(due_) <= ticks; }

// A frame that is more than a period late starts a new cadence.
void Stream::sent() {
  plan(period_ ? next_ + period_ : now());
  if (period_ && reached(due_)) plan(now() + period_);
}

void Stream::failed() {
  if (period_) return sent();
  plan(now() + RETRY_AFTER_FAILURE);
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

#if MRL_BRIDGE
void start_wheel_stream(const int16_t* args, uint8_t count) { start(READ_WHEELS, args, count); }
#endif
void stop_wheel_stream(const int16_t*, uint8_t) { streams::main.stop(READ_WHEELS); }

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
