// The truth table of the bridge chips: the drive of a motor as levels of its three pins.
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

// A drive forward or backward with a duty; 0 brakes, or lets the motor coast if the chip can.
Levels levels(Bridge chip, bool backward, uint8_t duty, bool coast);
// The fastest PWM that the chip bears, or nearly so.
hal::PwmRate rate(Bridge chip);

}  // namespace bridge
}  // namespace mrl
