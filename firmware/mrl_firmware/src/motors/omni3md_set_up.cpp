#include "omni3md_set_up.h"

#include "../board/config.h"

namespace mrl {
namespace motor {
namespace {

int16_t parameter(Parameter which) { return config::get(which); }

}  // namespace

Message set_up_message(uint8_t part) {
  switch (part) {
    case SET_GEOMETRY:
      return Message(GEOMETRY, 20)
          .word(parameter(Parameter::axis_radius))
          .word(parameter(Parameter::wheel_radius))
          .word(parameter(Parameter::gearbox))
          .word(parameter(Parameter::encoder_counts));
    case SET_GAINS:
      return Message(GAINS, 15)
          .word(parameter(Parameter::kp))
          .word(parameter(Parameter::ki))
          .word(parameter(Parameter::kd));
    case SET_RAMP:
      return Message(RAMP, 10).word(parameter(Parameter::ramp_time)).word(parameter(Parameter::ramp_gain));
    default: {
      const uint8_t timeout = static_cast<uint8_t>(parameter(Parameter::motor_timeout));
      return Message(TIMEOUT, 5).byte(timeout).byte(KEY_1).byte(timeout).byte(KEY_2);
    }
  }
}

uint8_t set_up_part(Parameter parameter) {
  if (parameter >= Parameter::axis_radius && parameter <= Parameter::encoder_counts) return SET_GEOMETRY;
  if (parameter >= Parameter::kp && parameter <= Parameter::kd) return SET_GAINS;
  if (parameter == Parameter::ramp_time || parameter == Parameter::ramp_gain) return SET_RAMP;
  return parameter == Parameter::motor_timeout ? SET_TIMEOUT : 0;
}

}  // namespace motor
}  // namespace mrl
