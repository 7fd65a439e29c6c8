// Whether the chip's pins can do what a wiring wants.  Pure: numbers in, the first problem out.
#pragma once
#include <stdint.h>

#include "../hal/hal.h"
#include "../serial/protocol.h"

namespace mrl {
namespace wiring {

struct Finding {
  WiringProblem problem;
  int8_t parameter, other;  // numbers of parameters; -1 is none
};

// Where the table of pins has the output of a bridge or the channel of an encoder: first all of the front motors, later all
// of the rear ones, which only a Mega has.
constexpr uint8_t MOTORS_TOGETHER = 2, WIRES = MOTORS_TOGETHER * hal::BRIDGE_WIRES;
constexpr uint8_t REAR = static_cast<uint8_t>(Parameter::pin_rear_left_pwm_a) - PIN_FIRST;
constexpr uint8_t first_place(uint8_t motor) { return motor < MOTORS_TOGETHER ? 0 : REAR; }
constexpr uint8_t bridge_place(uint8_t motor, uint8_t wire) {
  return static_cast<uint8_t>(first_place(motor) + motor % MOTORS_TOGETHER * hal::BRIDGE_WIRES + wire);
}
constexpr uint8_t encoder_place(uint8_t motor, uint8_t channel) {
  return static_cast<uint8_t>(first_place(motor) + WIRES + motor % MOTORS_TOGETHER * hal::CHANNELS + channel);
}

constexpr uint8_t SERVOS_OF_UNO = 2, RANGES_OF_UNO = 3;

// The first problem in the order of the problems, and of the parameters behind that; `pins` are the values from PIN_FIRST
// on.
Finding check(const int8_t* pins, Bridge bridge);

}  // namespace wiring
}  // namespace mrl
