#include "../../build.h"

#if MRL_BRIDGE

#include "wiring.h"

#include "../sensors/battery.h"
#include "../motors/bridge.h"
#include "bus.h"
#include "config.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../motors/servo.h"
#include "../sensors/inputs.h"
#include "../sensors/ranges.h"
#include "../sensors/sonar.h"
#include "../virtual/virtual_robot.h"
#include "wiring_check.h"

namespace mrl {
namespace wiring {
namespace {

Finding finding;
bool in_force;
constexpr uint8_t ENABLES = 2;

Parameter after(Parameter first, uint8_t places) { return static_cast<Parameter>(static_cast<uint8_t>(first) + places); }

int8_t pin_at(uint8_t place) { return pin(after(static_cast<Parameter>(PIN_FIRST), place)); }

hal::Wires wires() {
  hal::Wires wires;
  for (uint8_t motor = 0; motor < hal::MOTORS; motor++) {
    for (uint8_t i = 0; i < hal::BRIDGE_WIRES; i++) wires.bridge[motor][i] = pin_at(bridge_place(motor, i));
    wires.bridge[motor][hal::BRIDGE_WIRES] = motor < ENABLES ? pin(after(Parameter::pin_enable_1, motor)) : int8_t{NOT_CONNECTED};
    for (uint8_t i = 0; i < hal::CHANNELS; i++) wires.encoder[motor][i] = pin_at(encoder_place(motor, i));
  }
  for (uint8_t i = 0; i < hal::SERVOS; i++) wires.servo[i] = servo_pin(i);
  wires.ranges = ranges::timed();
  return wires;
}

}  // namespace

bool depends_on(Parameter parameter) {
  return parameter == Parameter::bridge || static_cast<uint8_t>(parameter) >= PIN_FIRST;
}

Bridge bridge() { return MRL_VIRTUAL ? virtual_robot::BRIDGE : static_cast<Bridge>(config::get(Parameter::bridge)); }

bool has(int16_t bits) { return (MRL_VIRTUAL ? WIRING_SET : config::get(Parameter::wiring)) & bits; }

void begin() {
  const Bridge chip = bridge();
  finding = MRL_VIRTUAL ? Finding{WiringProblem::none, -1, -1} : check(config::pins(), chip);
  in_force = chip != Bridge::unset && finding.problem == WiringProblem::none;
  if (!in_force) return;
  ranges::begin();
  hal::bridge_begin(wires(), bridge::rate(chip), bridge::roles(chip).pwm);
  if (pin(Parameter::i2c) > 0) bus::begin();
  servo::begin();
  sonar::begin();
  battery::begin();
  inputs::begin();
}

void end() {
  hal::bridge_end();
  bus::end();
  sonar::end();
  inputs::end();
  ranges::end();
  in_force = false;
}

bool accepted() { return in_force; }

uint8_t motors() {
  if (!in_force) return 0;
  const bool rear = MRL_MEGA && (pin_at(bridge_place(2, 0)) != NOT_CONNECTED || pin_at(bridge_place(2, 1)) != NOT_CONNECTED);
  return rear ? hal::MOTORS : uint8_t{2};
}

bool is_single(uint8_t encoder) {
  return !MRL_VIRTUAL && (has(WIRING_SINGLE_CHANNEL) || pin_at(encoder_place(encoder, 1)) == NOT_CONNECTED);
}

int8_t pin(Parameter parameter) {
  return static_cast<int8_t>(in_force && !MRL_VIRTUAL ? config::get(parameter) : NOT_CONNECTED);
}

// The table has those of a Mega alone behind the others.
int8_t servo_pin(uint8_t servo) {
  return pin(servo < SERVOS_OF_UNO ? after(Parameter::pin_servo_1, servo)
                                   : after(Parameter::pin_servo_3, static_cast<uint8_t>(servo - SERVOS_OF_UNO)));
}

int8_t range_pin(uint8_t range, bool echo) {
  const bool later = MRL_MEGA && range >= RANGES_OF_UNO;
  if (later) range = static_cast<uint8_t>(range - RANGES_OF_UNO);
  return pin(after(later ? Parameter::pin_range_4_trigger : Parameter::pin_range_1_trigger,
                   static_cast<uint8_t>(2 * range + echo)));
}

void report_board() {
  const int16_t channels = config::get(Parameter::no_encoders) ? 0 : is_single(0) ? 1 : 2;
  writer::add(MRL_MEGA ? 2560 : 328);
  writer::add(motors());
  writer::add(motors() ? channels : 0);
  writer::add(ranges::connected());
  writer::add(inputs::connected());
  int16_t servos = 0;
  for (uint8_t i = 0; i < hal::SERVOS; i++) servos = static_cast<int16_t>(servos | (servo_pin(i) != NOT_CONNECTED) << i);
  writer::add(servos);
}

void report() {
  writer::add(static_cast<int16_t>(finding.problem));
  writer::add(finding.parameter);
  writer::add(finding.other);
}

}  // namespace wiring
}  // namespace mrl

#endif
