#include "../hal/fast.h"
#include "bridge.h"

namespace mrl {
namespace bridge {
namespace {

constexpr uint8_t LOW_LEVEL = 0, HIGH_LEVEL = 255;

constexpr uint8_t A = 1, B = 2, LOGIC = 4;

}  // namespace

Roles roles(Bridge chip) {
  switch (chip) {
    case Bridge::vnh5019:
    case Bridge::tb6612:
    case Bridge::l298n_enable:
    case Bridge::l298p_brake:
      return {A | B | LOGIC, A};
    case Bridge::cytron:
    case Bridge::l298p:
      return {A | LOGIC, A};
    case Bridge::l298n:
      return {B | LOGIC, B};
    case Bridge::drv8833:
    case Bridge::bts7960:
      return {A | B, A | B};
    default:
      return {0, 0};
  }
}

// Brakes with all pins high, coasts with all pins low.  The table of the TB6612 has no row for all inputs low.  Behind a
// direction the motor brakes without pulses; the direction stays then, so that the end of the last pulse does not drive in
// the other one.
Levels levels(Bridge chip, bool backward, uint8_t duty, bool coast) {
  const uint8_t rest = static_cast<uint8_t>(HIGH_LEVEL - duty);
  const uint8_t ahead = backward ? LOW_LEVEL : HIGH_LEVEL, back = static_cast<uint8_t>(~ahead);
  if (chip == Bridge::unset) return {LOW_LEVEL, LOW_LEVEL, LOW_LEVEL};
  if (!duty && chip != Bridge::cytron && chip != Bridge::l298p) {
    const uint8_t level = coast ? LOW_LEVEL : HIGH_LEVEL;
    return {chip == Bridge::tb6612 ? HIGH_LEVEL : level, level, level};
  }
  switch (chip) {
    case Bridge::cytron:
    case Bridge::l298p:  // it coasts between the pulses, and at rest without its brake
    case Bridge::l298p_brake:
      return {duty, LOW_LEVEL, back};
    case Bridge::l298n:  // with PWM on IN1 it brakes between the pulses, which makes the speed proportional to the duty
      return {HIGH_LEVEL, backward ? rest : duty, back};
    case Bridge::drv8833:
    case Bridge::bts7960:  // the same; LOGIC is an enable, without which the BTS7960 cannot coast
      return {backward ? rest : HIGH_LEVEL, backward ? HIGH_LEVEL : rest, HIGH_LEVEL};
    default:  // two inputs for the direction, and PWM on a third one
      return {duty, ahead, back};
  }
}

hal::PwmRate rate(Bridge chip) {
  switch (chip) {
    case Bridge::vnh5019:
    case Bridge::cytron:
    case Bridge::bts7960:
      return hal::PwmRate::medium;
    case Bridge::tb6612:
    case Bridge::drv8833:
      return hal::PwmRate::fast;
    default:  // the L298
      return hal::PwmRate::slow;
  }
}

}  // namespace bridge
}  // namespace mrl
