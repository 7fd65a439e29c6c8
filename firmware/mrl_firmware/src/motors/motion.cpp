// Commands to the motors: moves, gains, encoders.
#include "../serial/answers.h"
#include "ceiling.h"
#include "../board/config.h"
#include "motor.h"
#include "../serial/protocol.h"
#include "../board/status.h"

namespace mrl {
namespace {

void require(bool available) {
  if (!available) status::refuse(Reason::unavailable);
}

}  // namespace

namespace handlers {

void calibrate(const int16_t*, uint8_t) { require(motor::calibrate()); }

void set_pid_gains(const int16_t* args, uint8_t) {
  if (!motor::available()) return status::refuse(Reason::unavailable);
  const Parameter gains[] = {Parameter::kp, Parameter::ki, Parameter::kd};
  bool changed = false;
  for (uint8_t i = 0; i < 3; i++) {
    changed = changed || config::get(gains[i]) != args[i];
    config::set(gains[i], args[i]);
  }
  if (changed) motor::refresh(Parameter::kp);  // each time writes the motor board's EEPROM
}

void set_encoder_prescaler(const int16_t* args, uint8_t) {
  require(motor::set_prescaler(static_cast<uint8_t>(args[0]), static_cast<uint8_t>(args[1])));
}

void preset_encoder(const int16_t* args, uint8_t) {
  require(motor::preset_encoder(static_cast<uint8_t>(args[0]), args[1]));
}

void reset_encoders(const int16_t*, uint8_t) { require(motor::reset_encoders()); }

void move_motors_pid(const int16_t* args, uint8_t) { require(motor::move_percent(args[0], args[1], true)); }

void move_motors(const int16_t* args, uint8_t) { require(motor::move_percent(args[0], args[1], false)); }

void move_differential(const int16_t* args, uint8_t) {
  int16_t linear = args[0], angular = args[1];
  ceiling::clamp(linear, angular);
  require(motor::move_speed(linear, angular));
}

void move_to_position(const int16_t* args, uint8_t) {
  require(motor::move_position(static_cast<uint8_t>(args[0]), args[1], args[2]));
}

void stop(const int16_t*, uint8_t) {
  require(motor::available());
  motor::stop(StopReason::host);
}

void robot_info(const int16_t*, uint8_t) { answers::ask(ROBOT_INFO); }

}  // namespace handlers
}  // namespace mrl
