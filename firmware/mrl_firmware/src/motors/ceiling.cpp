#include "ceiling.h"

#include "../board/config.h"
#include "../serial/protocol.h"
#include "../board/status.h"

namespace mrl {
namespace ceiling {
namespace {

uint16_t magnitude(int16_t value) {
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

uint32_t number(Parameter parameter) { return static_cast<uint32_t>(config::get(parameter)); }

// A rim speed in % of full speed, rounded down; full speed is 2 pi / 60 * full_speed * wheel_radius.
int16_t share(uint32_t rim) {
  const uint32_t percent = rim / (number(Parameter::full_speed) * number(Parameter::wheel_radius));
  return static_cast<int16_t>(percent < 100 ? percent : 100);
}

constexpr uint32_t PER_MM_S = 95492;  // 100 % * 60 / (2 pi) * 100, rounded down
constexpr uint32_t UP = 339, DOWN = 355;  // 3 / pi, for mrad/s times 0.01 mm

}  // namespace

void clamp(int16_t& linear, int16_t& angular) {
  scale(linear, angular, config::get(Parameter::linear_ceiling), config::get(Parameter::angular_ceiling));
}

void clamp_shares(int16_t& speed, int16_t& rotation) {
  const uint32_t linear = number(Parameter::linear_ceiling), angular = number(Parameter::angular_ceiling);
  const uint32_t turning = angular * number(Parameter::axis_radius) / DOWN * UP;
  scale(speed, rotation, linear == INT16_MAX ? INT16_MAX : share(linear * PER_MM_S),
        angular == INT16_MAX ? INT16_MAX : share(turning));
}

}  // namespace ceiling
}  // namespace mrl
