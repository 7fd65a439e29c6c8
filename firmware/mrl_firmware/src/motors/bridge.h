// What the bridge chips need: their pins, and their truth table with the drive of a motor as levels of its three pins.
#pragma once
#include <stdint.h>

#include "../hal/hal.h"
#include "../serial/protocol.h"

namespace mrl {
namespace bridge {

// 0 is low, 255 is high, and all between is the duty of a PWM output.
struct Levels {
  uint8_t pwm_a, pwm_b, logic;
};

// Pins as bits: 1 is PWM_A, 2 is PWM_B, 4 is LOGIC.
struct Roles {
  uint8_t needed, pwm;  // those that must be connected, and those that carry PWM if they are
};
Roles roles(Bridge chip);

// A drive forward or backward with a duty; 0 brakes, or lets the motor coast if the chip can.
Levels levels(Bridge chip, bool backward, uint8_t duty, bool coast);
// The fastest PWM that the chip bears, or nearly so.
hal::PwmRate rate(Bridge chip);

}  // namespace bridge
}  // namespace mrl
