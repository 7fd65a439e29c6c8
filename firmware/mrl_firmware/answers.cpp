#include "answers.h"

#include "config.h"
#include "debug.h"
#include "environment.h"
#include "failsafe.h"
#include "frame_writer.h"
#include "hal.h"
#include "i2c_sensors.h"
#include "motor_board.h"
#include "protocol.h"
#include "sonar.h"
#include "status.h"
#include "stream.h"

namespace mrl {
namespace answers {
namespace {

// What is left in the transmitter's queue when the counters for the next frame are read: the read takes 0.28 ms, a
// move and a battery read may come before it; 7 bytes are 0.6 ms on the wire.
constexpr uint8_t LOW_WATER = 7;
constexpr uint8_t QUESTIONS = 8;
constexpr int16_t NO_ENCODERS = 999;  // what sensor boards have sent since 2013 in place of counters

enum class Readiness : uint8_t { ready, wait, impossible };

struct Question {
  uint8_t code;
  int16_t value;
};

Question questions[QUESTIONS];
uint8_t first, waiting;
Question job;  // the frame whose values are being fetched; code 0 is none
bool job_is_stream;
bool counts_wanted;

bool is_sensor_stream(uint8_t code) { return code == START_SENSOR_STREAM || code == START_SENSOR_LDR_STREAM; }

// Boards of robots from 6 on need not have motors; a TraxBot or StingBot that has lost its motor board is broken.
bool has_no_motors() {
  return motor::asked() && !motor::ever_found() && config::get(Parameter::robot_id) > 5;
}

bool needs_counts(uint8_t code) {
  if (is_sensor_stream(code)) return !has_no_motors();
  return code == READ_ENCODERS || code == READ_ENCODERS_AND_SONARS;
}

bool needs_thermopile(uint8_t code) { return is_sensor_stream(code) || code == READ_THERMOPILE; }

// ---- are the values there?

Readiness counts_readiness() {
  switch (motor::counts_state()) {
    case motor::CountsState::ready:
      return Readiness::ready;
    case motor::CountsState::failed:
      return Readiness::impossible;
    default:
      return Readiness::wait;
  }
}

Readiness sensor_readiness(bool valid, bool known) {
  return valid ? Readiness::ready : known ? Readiness::impossible : Readiness::wait;
}

Readiness readiness() {
  Readiness sensor = Readiness::ready;
  if (needs_thermopile(job.code)) {
    sensor = sensor_readiness(i2c_sensors::thermopile_valid(), i2c_sensors::thermopile_known());
  }
  if (job.code == START_COMPASS_STREAM) {
    sensor = sensor_readiness(i2c_sensors::compass_valid(), i2c_sensors::compass_known());
  }
  if (job.code == ROBOT_INFO && !motor::asked()) sensor = Readiness::wait;
  if (sensor != Readiness::ready || !counts_wanted) return sensor;
  return counts_readiness();
}

// ---- the rows

void report_encoders() {
  const motor::Counts& counts = motor::counts();
  writer::add(counts_wanted ? counts.right : NO_ENCODERS);
  writer::add(counts_wanted ? counts.left : NO_ENCODERS);
}

void report_sensors() {
  report_encoders();
  writer::add(environment::alcohol());
  writer::add(environment::dust());
  writer::add(i2c_sensors::hottest());
  if (job.code == START_SENSOR_LDR_STREAM) writer::add(environment::light());
}

void report() {
  switch (job.code) {
    case ROBOT_INFO:
      return motor::report_info();
    case READ_ENCODERS:
      return report_encoders();
    case READ_SONARS:
      return sonar::report();
    case READ_ENCODERS_AND_SONARS:
      report_encoders();
      return sonar::report();
    case GET_DEBUG:
      return debug::report();
    case GET_STREAM:
      return stream::report();
    case READ_ALCOHOL:
      return writer::add(environment::alcohol());
    case READ_DUST:
      return writer::add(environment::dust());
    case READ_THERMOPILE:
      return i2c_sensors::report_pixels();
    case START_SENSOR_STREAM:
    case START_SENSOR_LDR_STREAM:
      return report_sensors();
    case START_COMPASS_STREAM:
      return writer::add(i2c_sensors::bearing());
    case READ_PROTOCOL:
      return status::report_protocol();
    case READ_STATUS:
      return status::report_status();
    case READ_COUNTERS:
      return status::report_counters();
    case SET_WATCHDOG:
      return failsafe::report_watchdog();
    case READ_CONFIG:
    case WRITE_CONFIG:
      return config::report(job.value);
    case DEFAULT_CONFIG:
      return writer::add(1);
    default:  // 32 and 36 answer with the value they were asked with
      return writer::add(job.value);
  }
}

bool is_stamped() { return needs_counts(job.code) || is_sensor_stream(job.code) || job.code == START_COMPASS_STREAM; }

// ---- one frame after the other

bool writer_has_begun;

void finish() {
  if (!writer_has_begun) writer::begin(job.code);
  report();
  if (is_stamped()) writer::stamp(counts_wanted ? motor::counts().tick : hal::ticks());
  writer::end();
  if (job_is_stream) stream::sent();
  job.code = 0;
}

void give_up() {
  if (writer_has_begun) writer::abandon();
  if (job_is_stream) {
    stream::failed();
  } else {
    status::refuse(Reason::unavailable);
  }
  job.code = 0;
}

void carry_on() {
  switch (readiness()) {
    case Readiness::ready:
      return finish();
    case Readiness::impossible:
      return give_up();
    case Readiness::wait:
      return;
  }
}

void start(const Question& question, bool is_stream) {
  job = question;
  job_is_stream = is_stream;
  writer_has_begun = false;
  counts_wanted = needs_counts(job.code);
  if (needs_thermopile(job.code)) i2c_sensors::want_thermopile();
  if (job.code == START_COMPASS_STREAM) i2c_sensors::want_compass();
  if (counts_wanted) {
    motor::want_counts();
    // The answer's head goes out while its counters are read; a stream's frame waits, the wire is busy anyway.
    if (!is_stream && motor::counts_state() != motor::CountsState::failed) {
      bus::service();
      writer::begin_early(job.code);
      writer_has_begun = true;
    }
  }
  carry_on();
}

void start_answer() {
  const Question question = questions[first];
  first = static_cast<uint8_t>((first + 1) % QUESTIONS);
  waiting--;
  start(question, false);
}

bool stream_had_last_turn;

void start_next() {
  if (!writer::idle() || hal::serial_waiting() > LOW_WATER) return;
  const bool stream_due = stream::due();
  if (waiting && !(stream_due && !stream_had_last_turn)) {
    stream_had_last_turn = false;
    start_answer();
  } else if (stream_due) {
    stream_had_last_turn = true;
    start({stream::code(), 0}, true);
  }
}

}  // namespace

void ask(uint8_t code, int16_t value) {
  if (waiting == QUESTIONS) return status::refuse(Reason::overrun);
  questions[(first + waiting) % QUESTIONS] = {code, value};
  waiting++;
  service();
}

bool about_to_read() { return waiting || job.code || stream::almost_due(); }

void service() {
  writer::service();
  if (job.code) {
    carry_on();
  } else {
    start_next();
  }
}

}  // namespace answers

namespace handlers {

void read_encoders(const int16_t*, uint8_t) { answers::ask(READ_ENCODERS); }
void read_encoders_and_sonars(const int16_t*, uint8_t) { answers::ask(READ_ENCODERS_AND_SONARS); }

}  // namespace handlers
}  // namespace mrl
