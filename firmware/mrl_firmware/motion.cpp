// Commands that go to the motor board: moves, gains, encoders.
#include "answers.h"
#include "ceiling.h"
#include "config.h"
#include "motor.h"
#include "protocol.h"
#include "status.h"

namespace mrl {
namespace {

void forward(const motor::Message& message) {
  if (!motor::send(message)) status::refuse(Reason::unavailable);
}

}  // namespace

namespace handlers {

void calibrate(const int16_t*, uint8_t) { forward(motor::Message(motor::CALIBRATE_MOTORS).byte(1).byte(1).byte(1).keys()); }

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
  forward(motor::Message(motor::PRESCALER, 10)
           .byte(static_cast<uint8_t>(args[0]))
           .byte(static_cast<uint8_t>(args[1]))
           .keys());
}

void preset_encoder(const int16_t* args, uint8_t) {
  forward(motor::Message(motor::PRESET).byte(static_cast<uint8_t>(args[0])).word(args[1]).keys());
}

void reset_encoders(const int16_t*, uint8_t) {
  for (uint8_t encoder = 1; encoder <= 3; encoder++) forward(motor::Message(motor::PRESET).byte(encoder).word(0).keys());
}

void move_motors_pid(const int16_t* args, uint8_t) {
  forward(motor::Message(motor::MOVE_PID).word(args[0]).word(0).word(args[1]));
}

void move_motors(const int16_t* args, uint8_t) {
  forward(motor::Message(motor::MOVE_PLAIN).word(args[0]).word(0).word(args[1]));
}

void move_differential(const int16_t* args, uint8_t) {
  int16_t linear = args[0], angular = args[1];
  ceiling::clamp(linear, angular);
  forward(motor::Message(motor::MOVE_SI).word(linear).word(angular));
}

void move_to_position(const int16_t* args, uint8_t) {
  forward(motor::Message(motor::MOVE_POSITION)
           .byte(static_cast<uint8_t>(args[0]))
           .word(args[1])
           .word(args[2])
           .byte(1));
}

void stop(const int16_t*, uint8_t) {
  if (!motor::available()) status::refuse(Reason::unavailable);
  motor::stop(StopReason::host);
}

void robot_info(const int16_t*, uint8_t) { answers::ask(ROBOT_INFO); }

}  // namespace handlers
}  // namespace mrl
