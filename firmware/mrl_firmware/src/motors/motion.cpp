// Commands to the motors: moves within the ceilings of the configuration, gains, encoders.
#include "../../build.h"
#include "../board/config.h"
#include "motor.h"
#include "../serial/protocol.h"
#include "../board/status.h"

namespace mrl {
namespace {

void require(bool available) {
  if (!available) status::refuse(Reason::unavailable);
}

// ---- ceilings

__attribute__((noinline)) uint16_t magnitude(int16_t value) {
  const uint16_t bits = static_cast<uint16_t>(value);
  return static_cast<uint16_t>(value < 0 ? 0u - bits : bits);
}

// The largest ceiling means no limit: -32768 is one beyond it and must pass unchanged.
bool beyond(int16_t value, int16_t most) { return most != INT16_MAX && magnitude(value) > static_cast<uint16_t>(most); }

uint32_t product(int16_t value, int16_t most) {
  return static_cast<uint32_t>(magnitude(value)) * static_cast<uint16_t>(most);
}

// Rounds towards zero.
int16_t scaled(int16_t value, int16_t most, uint16_t by) {
  return static_cast<int16_t>(static_cast<int32_t>(value) * most / static_cast<int32_t>(by));
}

// Scales both speeds by the larger excess, so that the arc keeps its radius, and counts the command.
void scale(int16_t& linear, int16_t& angular, int16_t most_linear, int16_t most_angular) {
  const bool fast = beyond(linear, most_linear), turning = beyond(angular, most_angular);
  if (!fast && !turning) return;
  status::count_clamped();
  const bool by_linear = !turning || (fast && product(linear, most_angular) > product(angular, most_linear));
  const int16_t most = by_linear ? most_linear : most_angular;
  const uint16_t was = magnitude(by_linear ? linear : angular);
  linear = scaled(linear, most, was);
  angular = scaled(angular, most, was);
}

#if MRL_MEGA
// The length of a vector, rounded down; at most 46 340.
uint16_t length(int16_t x, int16_t y) {
  const uint32_t square = static_cast<uint32_t>(magnitude(x)) * magnitude(x) + static_cast<uint32_t>(magnitude(y)) * magnitude(y);
  uint32_t root = 0;
  for (uint32_t bit = 0x8000; bit; bit >>= 1) {
    if ((root | bit) * (root | bit) <= square) root |= bit;
  }
  return static_cast<uint16_t>(root);
}
#endif

uint32_t number(Parameter parameter) { return static_cast<uint32_t>(config::get(parameter)); }

// A rim speed in % of full speed, rounded down; full speed is 2 pi / 60 * full_speed * wheel_radius.
int16_t share(uint32_t rim) {
  const uint32_t percent = rim / (number(Parameter::full_speed) * number(Parameter::wheel_radius));
  return static_cast<int16_t>(percent < 100 ? percent : 100);
}

constexpr uint32_t PER_MM_S = 95492;  // 100 % * 60 / (2 pi) * 100, rounded down
constexpr uint32_t UP = 339, DOWN = 355;  // 3 / pi, for mrad/s times 0.01 mm

// Speeds of the omnidirectional mode, in % of full speed; rotation is that of the wheels.
void clamp_shares(int16_t& speed, int16_t& rotation) {
  const uint32_t linear = number(Parameter::linear_ceiling), angular = number(Parameter::angular_ceiling);
  const uint32_t turning = angular * number(Parameter::axis_radius) / DOWN * UP;
  scale(speed, rotation, linear == INT16_MAX ? INT16_MAX : share(linear * PER_MM_S),
        angular == INT16_MAX ? INT16_MAX : share(turning));
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
  require(motor::available() && motor::set_prescaler(static_cast<uint8_t>(args[0]), static_cast<uint8_t>(args[1])));
}

void preset_encoder(const int16_t* args, uint8_t) {
  require(motor::preset_encoder(static_cast<uint8_t>(args[0]), args[1]));
}

void reset_encoders(const int16_t*, uint8_t) { require(motor::reset_encoders()); }

void move_motors_pid(const int16_t* args, uint8_t) { require(motor::move_percent(args[0], args[1], true)); }

void move_motors(const int16_t* args, uint8_t) { require(motor::move_percent(args[0], args[1], false)); }

void move_differential(const int16_t* args, uint8_t) {
  int16_t linear = args[0], angular = args[1];
  scale(linear, angular, config::get(Parameter::linear_ceiling), config::get(Parameter::angular_ceiling));
  require(motor::move_twist(linear, 0, angular));
}

#if MRL_MEGA
// The ceiling is that of the speed in its own direction: `left` keeps its share of it.  A speed that does not fit into a
// field is lowered to one that does.
void move_twist(const int16_t* args, uint8_t) {
  const uint16_t was = length(args[0], args[1]);
  int16_t linear = static_cast<int16_t>(was < INT16_MAX ? was : INT16_MAX);
  const auto part = [&](int16_t value) { return magnitude(linear) == was ? value : scaled(value, linear, was); };
  int16_t angular = part(args[2]);
  scale(linear, angular, config::get(Parameter::linear_ceiling), config::get(Parameter::angular_ceiling));
  require(motor::move_twist(part(args[0]), part(args[1]), angular));
}

void move_wheels(const int16_t* args, uint8_t) { require(motor::move_wheels(args)); }
#elif MRL_BRIDGE
void move_wheels(const int16_t*, uint8_t) { require(false); }

// Two wheels cannot move sideways.
void move_twist(const int16_t* args, uint8_t count) {
  if (args[1]) return move_wheels(args, count);
  const int16_t speeds[] = {args[0], args[2]};
  move_differential(speeds, count);
}
#endif

// Robots with three omni wheels.
void move_omni(const int16_t* args, uint8_t) {
  if (MRL_BRIDGE || !(motor::capabilities() & CAPABILITY_OMNI)) return status::refuse(Reason::unavailable);
  int16_t speed = args[0], rotation = args[1];
  clamp_shares(speed, rotation);
  require(motor::move_omni(static_cast<uint8_t>(speed), rotation, args[2]));
}

void move_to_position(const int16_t* args, uint8_t) {
  require(motor::move_position(static_cast<uint8_t>(args[0]), args[1], args[2]));
}

void stop(const int16_t*, uint8_t) {
  require(motor::available());
  motor::stop(StopReason::host);
  status::host_stopped();
}

}  // namespace handlers
}  // namespace mrl
