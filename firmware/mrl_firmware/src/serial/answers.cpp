#include "../hal/fast.h"
#include "answers.h"

#include "baud.h"
#include "../board/board_clock.h"
#include "../../build.h"
#include "../board/bus.h"
#include "frame_writer.h"
#include "../hal/hal.h"
#include "../sensors/imu.h"
#include "../motors/motor.h"
#include "protocol.h"
#include "rows.h"
#include "../board/status.h"
#include "stream.h"

namespace mrl {
namespace answers {
namespace {

// The counters for the next frame are read when this many bytes are left in the transmitter's queue.  The read takes
// 0.28 ms, after perhaps a move and a battery read; 7 bytes take 0.6 ms on the serial link.
constexpr uint8_t LOW_WATER = hal::SERIAL_OUT_NEWS;
constexpr uint8_t QUESTIONS = 8;
constexpr uint8_t ALMOST = 8;  // 0.5 ms in ticks: a battery read takes 0.2 ms

// An IMU frame and the reads before it take at most this long at the slowest baud rate, in ticks: 6.6 ms.
constexpr uint8_t IMU_FRAME = 104;

struct Question {
  uint8_t code;
  int16_t value;
};

Question questions[QUESTIONS];
uint8_t first, waiting;

// The frame that is being built.  Its counters or the IMU are read last, so that they are fresh.
enum class Stage : uint8_t { none, sensors, reads } stage;
Question job;
Stream* job_stream;       // null for an answer
const Stream* last_turn;  // the stream of the last frame; null for an answer
bool with_counts, writer_has_begun;
bool imu_due;    // in the last start_next(), unless an answer had to start then
bool imu_ahead;  // the IMU is read for its next frame already

uint16_t tick() {
  if (job.code == READ_IMU) return imu::tick();
  return with_counts ? motor::counts().tick : hal::ticks();
}

void finish() {
  if (!writer_has_begun) writer::begin(job.code);
  rows::report(job.code, job.value, with_counts);
  if (rows::is_stamped(job.code)) writer::stamp(tick());
  writer::end();
  if (job_stream) job_stream->sent();
  stage = Stage::none;
}

void give_up() {
  if (writer_has_begun) writer::abandon();
  if (job_stream) {
    job_stream->failed();
  } else {
    status::refuse(Reason::unavailable);
  }
  stage = Stage::none;
}

rows::Readiness reads_readiness() {
  if (job.code == READ_IMU) return imu::readiness();
  const motor::CountsState state = motor::counts_state();
  return state == motor::CountsState::ready    ? rows::Readiness::ready
         : state == motor::CountsState::failed ? rows::Readiness::impossible
                                               : rows::Readiness::wait;
}

void await_reads() {
  const rows::Readiness readiness = reads_readiness();
  if (readiness == rows::Readiness::ready) finish();
  if (readiness == rows::Readiness::impossible) give_up();
}

// If an IMU frame is due as well, the IMU is read directly after the counters.  The head of an answer is sent while its
// counters are read.  A stream frame waits: the serial link is busy anyway.
void fetch_counts() {
  motor::want_counts();
  imu_ahead = job_stream && imu_due;
  if (imu_ahead) imu::want();
  bus::service();
  if (!job_stream && motor::counts_state() != motor::CountsState::failed) {
    writer::begin_early(job.code);
    writer_has_begun = true;
  }
}

void fetch_imu() {
  if (!imu_ahead || !job_stream) imu::want();
  imu_ahead = false;
  bus::service();
}

// With an H-bridge, whose counts are there at once, a pass may do all of a frame: bytes of the host, which may be a stop,
// come between its parts.  The rest of an answer whose head is out has time.
bool gives_way() {
  if (!MRL_BRIDGE || !(writer_has_begun || hal::serial_received())) return false;
  board_clock::stay_awake();
  return true;
}

void await_sensors() {
  const rows::Readiness readiness = rows::readiness(job.code);
  if (readiness == rows::Readiness::impossible) return give_up();
  if (readiness == rows::Readiness::wait) return;
  with_counts = rows::needs_counts(job.code);
  if (!with_counts && job.code != READ_IMU) return finish();
  stage = Stage::reads;
  if (with_counts) {
    fetch_counts();
  } else {
    fetch_imu();
  }
  if (!gives_way()) await_reads();
}

void start(const Question& question, Stream* stream) {
  job = question;
  job_stream = stream;
  last_turn = stream;
  writer_has_begun = false;
  stage = Stage::sensors;
  board_clock::stay_awake();
  rows::want_sensors(job.code);
  if (!gives_way()) await_sensors();
}

void start_answer() {
  const Question question = questions[first];
  first = static_cast<uint8_t>((first + 1) % QUESTIONS);
  waiting--;
  start(question, nullptr);
}

void start_frame(Stream& stream) { start({stream.code(), 0}, &stream); }

// An IMU frame gives way to answers, and to frames of the other stream that are due or that it would delay.  Behind one of
// those frames it goes first if the stream has no period, and behind either if it is late.
bool imu_has_turn(bool main_due) {
  const bool behind_main = last_turn == &streams::main;
  if (!imu_due || (main_due && !behind_main)) return false;
  if (!main_due && !streams::main.due_within(IMU_FRAME)) return !waiting || (!last_turn && streams::imu.late());
  return behind_main && ((!waiting && !streams::main.has_period()) || streams::imu.late());
}

void start_next() {
  if (!writer::idle() || hal::serial_waiting() > LOW_WATER) return;
  const bool streaming = !baud::changing();
  const bool main_due = streaming && streams::main.due();
  imu_due = streaming && !(waiting && last_turn == &streams::imu) && streams::imu.due();
  if (imu_has_turn(main_due)) {
    start_frame(streams::imu);
  } else if (waiting && (!main_due || last_turn)) {
    start_answer();
  } else if (main_due) {
    start_frame(streams::main);
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

bool reading() { return stage == Stage::none ? streams::main.due_within(ALMOST) : stage == Stage::reads; }

bool about_to_read() { return (stage == Stage::none && waiting) || reading(); }

void service() {
  writer::service();
  switch (stage) {
    case Stage::none:
      return start_next();
    case Stage::sensors:
      return await_sensors();
    case Stage::reads:
      return await_reads();
  }
}

}  // namespace answers
}  // namespace mrl
