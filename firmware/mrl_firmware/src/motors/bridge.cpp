#include "bridge.h"

namespace mrl {
namespace bridge {
namespace {

constexpr uint8_t LOW_LEVEL = 0, HIGH_LEVEL = 255;

// Two inputs for the direction, and PWM on a third one.
Levels with_two_inputs(Bridge chip, bool backward, uint8_t duty, bool coast) {
  if (duty) {
    return backward ? Levels{duty, LOW_LEVEL, HIGH_LEVEL} : Levels{duty, HIGH_LEVEL, LOW_LEVEL};
  }
  if (!coast) return {HIGH_LEVEL, HIGH_LEVEL, HIGH_LEVEL};
  // The TB6612's table has no row for all inputs low.
  return {chip == Bridge::tb6612 ? HIGH_LEVEL : LOW_LEVEL, LOW_LEVEL, LOW_LEVEL};
}

// The L298N coasts while EN is low.  With PWM on IN1 it brakes between the pulses, which makes the speed proportional to
// the duty.
Levels with_enable(bool backward, uint8_t duty, bool coast) {
  if (!duty && coast) return {LOW_LEVEL, LOW_LEVEL, LOW_LEVEL};
  if (backward) return {HIGH_LEVEL, static_cast<uint8_t>(HIGH_LEVEL - duty), HIGH_LEVEL};
  return duty ? Levels{HIGH_LEVEL, duty, LOW_LEVEL} : Levels{HIGH_LEVEL, HIGH_LEVEL, HIGH_LEVEL};
}

// EN carries the PWM, so that the motor coasts between the pulses.
Levels with_pwm_on_enable(bool backward, uint8_t duty, bool coast) {
  if (!duty) return coast ? Levels{LOW_LEVEL, LOW_LEVEL, LOW_LEVEL} : Levels{HIGH_LEVEL, HIGH_LEVEL, HIGH_LEVEL};
  return backward ? Levels{duty, LOW_LEVEL, HIGH_LEVEL} : Levels{duty, HIGH_LEVEL, LOW_LEVEL};
}

// The direction stays while the motor brakes, so that the end of the last pulse does not drive in the other direction.
Levels with_direction(bool backward, uint8_t duty) { return {duty, LOW_LEVEL, backward ? HIGH_LEVEL : LOW_LEVEL}; }

// The motor brakes while both inputs are high, so that its speed is proportional to the duty.  LOGIC is an enable, without
// which the BTS7960 cannot coast.
Levels with_pwm_on_both(bool backward, uint8_t duty, bool coast) {
  if (!duty && coast) return {LOW_LEVEL, LOW_LEVEL, LOW_LEVEL};
  const uint8_t rest = static_cast<uint8_t>(HIGH_LEVEL - duty);
  return backward ? Levels{rest, HIGH_LEVEL, HIGH_LEVEL} : Levels{HIGH_LEVEL, rest, HIGH_LEVEL};
}

constexpr uint8_t A = 1, B = 2, LOGIC = 4;

}  // namespace

Roles roles(Bridge chip) {
  switch (chip) {
    case Bridge::vnh5019:
    case Bridge::tb6612:
    case Bridge::l298n_enable:
      return {A | B | LOGIC, A};
    case Bridge::cytron:
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

Levels levels(Bridge chip, bool backward, uint8_t duty, bool coast) {
  switch (chip) {
    case Bridge::vnh5019:
    case Bridge::tb6612:
      return with_two_inputs(chip, backward, duty, coast);
    case Bridge::l298n:
      return with_enable(backward, duty, coast);
    case Bridge::cytron:
      return with_direction(backward, duty);
    case Bridge::drv8833:
    case Bridge::bts7960:
      return with_pwm_on_both(backward, duty, coast);
    case Bridge::l298n_enable:
      return with_pwm_on_enable(backward, duty, coast);
    default:
      return {LOW_LEVEL, LOW_LEVEL, LOW_LEVEL};
  }
}

hal::PwmRate rate(Bridge chip) {
  if (chip == Bridge::l298n || chip == Bridge::l298n_enable) return hal::PwmRate::slow;
  return chip == Bridge::tb6612 || chip == Bridge::drv8833 ? hal::PwmRate::fast : hal::PwmRate::medium;
}

}  // namespace bridge
}  // namespace mrl
