#include "stream.h"

#include "answers.h"
#include "board_clock.h"
#include "build.h"
#include "frame_writer.h"
#include "protocol.h"
#include "status.h"

namespace mrl {
namespace stream {
namespace {

// Times in eighths of a tick, 8 us, so that each period in ms is whole and the cadence never drifts.
constexpr uint32_t EIGHTHS_PER_MS = 125;
constexpr uint32_t ALMOST = 64;                             // 0.5 ms: a battery read takes 0.2 ms
constexpr uint32_t RETRY_AFTER_FAILURE = 5 * EIGHTHS_PER_MS;  // when no period is set

uint8_t running;
uint32_t period;
uint32_t next;

uint32_t now() { return board_clock::now() << 3; }

int32_t left_until(uint32_t time) { return static_cast<int32_t>(time - now()); }

bool reached(uint32_t time) {
  const int32_t left = left_until(time);
  return board_clock::passed(board_clock::now(), left > 0 ? static_cast<uint32_t>(left + 7) / 8 : 0);
}

void start(uint8_t code, const int16_t* args, uint8_t count) {
  running = code;
  period = count ? static_cast<uint32_t>(args[0]) * EIGHTHS_PER_MS : 0;
  next = now();
}

void stop(uint8_t code) {
  if (running == code) running = 0;
}

}  // namespace

uint8_t code() { return running; }

bool due() { return running && reached(next); }

bool almost_due() { return running && period && left_until(next - ALMOST) <= 0; }

// A frame that is more than a period late starts a new cadence.
void sent() {
  next = period ? next + period : now();
  if (period && reached(next)) next = now() + period;
}

void failed() {
  if (period) return sent();
  next = now() + RETRY_AFTER_FAILURE;
}

void report() { writer::add(running != 0); }

}  // namespace stream

namespace handlers {
namespace {

void start_with_sensors(uint8_t code, const int16_t* args, uint8_t count) {
  if (!MRL_ENVIRONMENT) return status::refuse(Reason::unavailable);
  stream::start(code, args, count);
}

}  // namespace

void get_stream(const int16_t*, uint8_t) { answers::ask(GET_STREAM); }

void start_stream(const int16_t* args, uint8_t count) { stream::start(READ_ENCODERS_AND_SONARS, args, count); }

void start_omni_stream(const int16_t* args, uint8_t count) { stream::start(START_OMNI_STREAM, args, count); }

void stop_stream(const int16_t*, uint8_t) {
  stream::stop(READ_ENCODERS_AND_SONARS);
  stream::stop(START_OMNI_STREAM);
}

void start_sensor_stream(const int16_t* args, uint8_t count) {
  start_with_sensors(START_SENSOR_STREAM, args, count);
}

void stop_sensor_stream(const int16_t*, uint8_t) { stream::stop(START_SENSOR_STREAM); }

void start_sensor_ldr_stream(const int16_t* args, uint8_t count) {
  start_with_sensors(START_SENSOR_LDR_STREAM, args, count);
}

void stop_sensor_ldr_stream(const int16_t*, uint8_t) { stream::stop(START_SENSOR_LDR_STREAM); }

void start_compass_stream(const int16_t* args, uint8_t count) {
  start_with_sensors(START_COMPASS_STREAM, args, count);
}

void stop_compass_stream(const int16_t*, uint8_t) { stream::stop(START_COMPASS_STREAM); }

}  // namespace handlers
}  // namespace mrl
