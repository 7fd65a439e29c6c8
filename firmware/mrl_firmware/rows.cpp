#include "rows.h"

#include "config.h"
#include "debug.h"
#include "environment.h"
#include "failsafe.h"
#include "flash.h"
#include "frame_writer.h"
#include "i2c_sensors.h"
#include "motor_board.h"
#include "protocol.h"
#include "sonar.h"
#include "status.h"
#include "stream.h"
#include "xbee.h"

namespace mrl {
namespace rows {
namespace {

constexpr int16_t NO_ENCODERS = 999;  // what sensor boards have sent since 2013 in place of counters
constexpr int16_t LAST_WITH_MOTORS = 5;

#define STAMPED(code, name, least, most, guarded, stamped, first) stamped,
const uint8_t STAMPED_ROWS[] PROGMEM = {MRL_COMMANDS(STAMPED, STAMPED)};
#undef STAMPED

bool is_sensor_stream(uint8_t code) { return code == START_SENSOR_STREAM || code == START_SENSOR_LDR_STREAM; }

// Boards of robots from 6 on need not have motors; a TraxBot or StingBot that has lost its motor board is broken.
bool has_no_motors() {
  return motor::asked() && !motor::ever_found() && config::get(Parameter::robot_id) > LAST_WITH_MOTORS;
}

bool needs_thermopile(uint8_t code) { return is_sensor_stream(code) || code == READ_THERMOPILE; }

Readiness sensor(bool valid, bool known) {
  return valid ? Readiness::ready : known ? Readiness::impossible : Readiness::wait;
}

void report_encoders(bool with_counts) {
  const motor::Counts& counts = motor::counts();
  writer::add(with_counts ? counts.right : NO_ENCODERS);
  writer::add(with_counts ? counts.left : NO_ENCODERS);
}

void report_sensors(bool with_counts) {
  report_encoders(with_counts);
  writer::add(environment::alcohol());
  writer::add(environment::dust());
  writer::add(i2c_sensors::hottest());
}

// Codes 20 to 28.
void report_environment(uint8_t code, bool with_counts) {
  switch (code) {
    case READ_ALCOHOL:
      return writer::add(environment::alcohol());
    case READ_DUST:
      return writer::add(environment::dust());
    case READ_THERMOPILE:
      return i2c_sensors::report_pixels();
    case START_SENSOR_STREAM:
      return report_sensors(with_counts);
    case START_SENSOR_LDR_STREAM:
      report_sensors(with_counts);
      return writer::add(environment::light());
    default:
      return writer::add(i2c_sensors::bearing());
  }
}

}  // namespace

bool needs_counts(uint8_t code) {
  if (is_sensor_stream(code)) return !has_no_motors();
  return code == READ_ENCODERS || code == READ_ENCODERS_AND_SONARS;
}

bool is_stamped(uint8_t code) { return flash_byte(&STAMPED_ROWS[code - 1]); }

void want_sensors(uint8_t code) {
  if (needs_thermopile(code)) i2c_sensors::want_thermopile();
  if (code == START_COMPASS_STREAM) i2c_sensors::want_compass();
}

Readiness sensors(uint8_t code) {
  if (needs_thermopile(code)) return sensor(i2c_sensors::thermopile_valid(), i2c_sensors::thermopile_known());
  if (code == START_COMPASS_STREAM) return sensor(i2c_sensors::compass_valid(), i2c_sensors::compass_known());
  return code == ROBOT_INFO && !motor::asked() ? Readiness::wait : Readiness::ready;
}

void report(uint8_t code, int16_t value, bool with_counts) {
  if (code >= READ_ALCOHOL && code <= STOP_COMPASS_STREAM) return report_environment(code, with_counts);
  switch (code) {
    case ROBOT_INFO:
      return motor::report_info();
    case READ_ENCODERS:
      return report_encoders(with_counts);
    case READ_SONARS:
      return sonar::report();
    case READ_ENCODERS_AND_SONARS:
      report_encoders(with_counts);
      return sonar::report();
    case GET_DEBUG:
      return debug::report();
    case GET_STREAM:
      return stream::report();
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
      return config::report(value);
    case XBEE_TEXT:
      return xbee::report_text();
    case DISCOVER_XBEE:
      return xbee::report_node();
    default:  // 32, 36 and 37 answer with the value they were asked with
      return writer::add(value);
  }
}

}  // namespace rows
}  // namespace mrl
