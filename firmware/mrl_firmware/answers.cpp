#include "answers.h"

#include "baud.h"
#include "board_clock.h"
#include "bus.h"
#include "frame_writer.h"
#include "hal.h"
#include "motor.h"
#include "protocol.h"
#include "rows.h"
#include "status.h"
#include "stream.h"

namespace mrl {
namespace answers {
namespace {

// The counters for the next frame are read when this many bytes are left in the transmitter's queue.  The read takes
// 0.28 ms, after perhaps a move and a battery read; 7 bytes take 0.6 ms on the serial link.
constexpr uint8_t LOW_WATER = hal::SERIAL_OUT_NEWS;
constexpr uint8_t QUESTIONS = 8;

struct Question {
  uint8_t code;
  int16_t value;
};

Question questions[QUESTIONS];
uint8_t first, waiting;

// The frame that is being built.  Its counters are fetched last, so that they are fresh.
enum class Stage : uint8_t { none, sensors, counts } stage;
Question job;
bool job_is_stream, with_counts, writer_has_begun, stream_had_last_turn;

void finish() {
  if (!writer_has_begun) writer::begin(job.code);
  rows::report(job.code, job.value, with_counts);
  if (rows::is_stamped(job.code)) writer::stamp(with_counts ? motor::counts().tick : hal::ticks());
  writer::end();
  if (job_is_stream) stream::sent();
  stage = Stage::none;
}

void give_up() {
  if (writer_has_begun) writer::abandon();
  if (job_is_stream) {
    stream::failed();
  } else {
    status::refuse(Reason::unavailable);
  }
  stage = Stage::none;
}

void await_counts() {
  const motor::CountsState state = motor::counts_state();
  if (state == motor::CountsState::ready) finish();
  if (state == motor::CountsState::failed) give_up();
}

// The head of an answer is sent while its counters are read.  A stream frame waits: the serial link is busy anyway.
void fetch_counts() {
  stage = Stage::counts;
  motor::want_counts();
  bus::service();
  if (!job_is_stream && motor::counts_state() != motor::CountsState::failed) {
    writer::begin_early(job.code);
    writer_has_begun = true;
  }
  await_counts();
}

void await_sensors() {
  const rows::Readiness readiness = rows::readiness(job.code);
  if (readiness == rows::Readiness::impossible) return give_up();
  if (readiness == rows::Readiness::wait) return;
  with_counts = rows::needs_counts(job.code);
  if (with_counts) {
    fetch_counts();
  } else {
    finish();
  }
}

void start(const Question& question, bool is_stream) {
  job = question;
  job_is_stream = is_stream;
  writer_has_begun = false;
  stage = Stage::sensors;
  board_clock::stay_awake();
  rows::want_sensors(job.code);
  await_sensors();
}

void start_answer() {
  const Question question = questions[first];
  first = static_cast<uint8_t>((first + 1) % QUESTIONS);
  waiting--;
  start(question, false);
}

void start_next() {
  if (!writer::idle() || hal::serial_waiting() > LOW_WATER) return;
  const bool stream_due = stream::due() && !baud::changing();
  if (waiting && !(stream_due && !stream_had_last_turn)) {
    stream_had_last_turn = false;
    start_answer();
  } else if (stream_due) {
    stream_had_last_turn = true;
    start({stream::code(), 0}, true);
  }
}

}  // namespace

bool can_ask() { return waiting < QUESTIONS; }

void ask(uint8_t code, int16_t value) {
  if (!can_ask()) return status::refuse(Reason::overrun);
  questions[(first + waiting) % QUESTIONS] = {code, value};
  waiting++;
  service();
}

bool silent() { return !waiting && stage == Stage::none && writer::idle() && !hal::serial_waiting(); }

bool about_to_read() {
  if (stage == Stage::none) return waiting || stream::almost_due();
  return stage == Stage::counts;
}

void service() {
  writer::service();
  switch (stage) {
    case Stage::none:
      return start_next();
    case Stage::sensors:
      return await_sensors();
    case Stage::counts:
      return await_counts();
  }
}

}  // namespace answers

namespace handlers {

void read_encoders(const int16_t*, uint8_t) { answers::ask(READ_ENCODERS); }
void read_encoders_and_sonars(const int16_t*, uint8_t) { answers::ask(READ_ENCODERS_AND_SONARS); }

}  // namespace handlers
}  // namespace mrl
