#include "../hal/fast.h"
#include "rows.h"

#include "../board/config.h"
#include "debug.h"
#include "../board/failsafe.h"
#include "../hal/flash.h"
#include "frame_writer.h"
#include "../sensors/imu.h"
#include "../sensors/inputs.h"
#include "../motors/motor.h"
#include "../motors/servo.h"
#include "protocol.h"
#include "../sensors/ranges.h"
#include "../sensors/sensors.h"
#include "../sensors/sonar.h"
#include "../board/status.h"
#include "stream.h"
#include "../board/wiring.h"
#include "../virtual/virtual_robot.h"
#include "../radio/xbee.h"

namespace mrl {
namespace rows {
namespace {

constexpr int16_t NO_ENCODERS = 999;  // value that sensor boards have sent instead of counters since 2013
constexpr int16_t LAST_WITH_MOTORS = 5;

constexpr uint8_t ANSWERED = 1, STAMPED = 2;  // values of `reply`
#define REPLY(code, constant, name, there, least, most, guarded, reply, ...) reply,
const uint8_t REPLIES[] PROGMEM = {MRL_COMMANDS(REPLY, REPLY, REPLY)};

bool is_sensor_stream(uint8_t code) { return code == START_SENSOR_STREAM || code == START_SENSOR_LDR_STREAM; }

// Boards with a robot id from 6 on may have no motors; a TraxBot or StingBot without its motor board is faulty.
bool has_no_motors() {
  return motor::asked() && !motor::ever_found() && config::get(Parameter::robot_id) > LAST_WITH_MOTORS;
}

// The sensor that a frame must wait for, if any.
uint8_t sensor_of(uint8_t code) {
  if (is_sensor_stream(code)) return READ_THERMOPILE;
  if (code == START_COMPASS_STREAM) return READ_COMPASS;
  return code;
}

void report_encoders(bool with_counts) {
  const motor::Counts& counts = motor::counts();
  writer::add(with_counts ? counts.right : NO_ENCODERS);
  writer::add(with_counts ? counts.left : NO_ENCODERS);
}

#if MRL_ENVIRONMENT
void report_sensors(bool with_counts) {
  report_encoders(with_counts);
  writer::add(sensors::alcohol());
  writer::add(sensors::dust());
  writer::add(sensors::largest(READ_THERMOPILE));
}
#endif

#if MRL_BRIDGE
void report_wheels() {
  motor::report_wheels();
  writer::add(inputs::active());
  ranges::report();
}
#endif

}  // namespace

bool needs_counts(uint8_t code) {
  if (is_sensor_stream(code)) return !has_no_motors();
  return code == READ_ENCODERS || code == READ_ENCODERS_AND_SONARS || code == START_OMNI_STREAM ||
         (MRL_BRIDGE && code == READ_WHEELS);
}

bool is_stamped(uint8_t code) { return flash_byte(&REPLIES[code - 1]) == STAMPED; }

bool is_answered(uint8_t code) { return flash_byte(&REPLIES[code - 1]) == ANSWERED; }

void want_sensors(uint8_t code) {
  if (sensors::ANY && code >= READ_ALCOHOL) sensors::want(sensor_of(code));
}

Readiness readiness(uint8_t code) {
  if (code == READ_PROTOCOL && !imu::asked()) return Readiness::wait;
  if (sensors::ANY && code >= READ_ALCOHOL) return sensors::readiness(sensor_of(code));
  return code == ROBOT_INFO && !motor::asked() ? Readiness::wait : Readiness::ready;
}

void report(uint8_t code, int16_t value, bool with_counts) {
  switch (code) {
    case ROBOT_INFO: return motor::report_info();
    case READ_ENCODERS: return report_encoders(with_counts);
    case READ_SONARS: return sonar::report();
    case READ_ENCODERS_AND_SONARS:
      report_encoders(with_counts);
      return sonar::report();
    case START_OMNI_STREAM:
      report_encoders(true);
      writer::add(motor::counts().rear);
      return sonar::report();
#if MRL_ENVIRONMENT
    case START_SENSOR_STREAM: return report_sensors(with_counts);
    case START_SENSOR_LDR_STREAM:
      report_sensors(with_counts);
      return sensors::report(READ_LIGHT);
    case START_COMPASS_STREAM: return sensors::report(READ_COMPASS);
#endif
    case GET_DEBUG: return debug::report();
    case GET_STREAM: return streams::report();
    case READ_PROTOCOL: return status::report_protocol();
    case READ_STATUS: return status::report_status();
    case READ_COUNTERS: return status::report_counters();
    case SET_WATCHDOG: return failsafe::report_watchdog();
    case READ_CONFIG:
    case WRITE_CONFIG: return config::report(value);
    case READ_IMU: return imu::report();
#if MRL_XBEE
    case XBEE_TEXT: return xbee::report_text();
    case DISCOVER_XBEE: return xbee::report_node();
    case READ_RADIO: return xbee::report_radio();
#endif
#if MRL_BRIDGE
    case READ_WIRING: return wiring::report();
    case SET_SERVO: return servo::report(value);
    case READ_BOARD: return wiring::report_board();
    case READ_WHEELS: return report_wheels();
    case READ_INPUTS: return inputs::report();
    case READ_RANGES: return ranges::report();
#endif
#if MRL_VIRTUAL
    case READ_VIRTUAL_POSE: return virtual_robot::report_pose();
#endif
    default:  // 32, 36, 37, 45, 50 and 60 answer with the value they were asked with
      return sensors::ANY && sensors::knows(code) ? sensors::report(code) : writer::add(value);
  }
}

}  // namespace rows
}  // namespace mrl
