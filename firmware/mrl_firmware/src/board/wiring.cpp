#include "../../build.h"

#if MRL_BRIDGE

#include "wiring.h"

#include "../sensors/battery.h"
#include "../motors/bridge.h"
#include "bus.h"
#include "config.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../sensors/sonar.h"
#include "wiring_check.h"

namespace mrl {
namespace wiring {
namespace {

Finding finding;
bool in_force;

Parameter after(Parameter first, uint8_t places) { return static_cast<Parameter>(static_cast<uint8_t>(first) + places); }

hal::Wires wires() {
  hal::Wires wires;
  for (uint8_t motor = 0; motor < hal::MOTORS; motor++) {
    for (uint8_t i = 0; i < hal::BRIDGE_PINS; i++) {
      wires.bridge[motor][i] = pin(after(Parameter::pin_left_pwm_a, static_cast<uint8_t>(motor * hal::BRIDGE_PINS + i)));
    }
    for (uint8_t i = 0; i < hal::CHANNELS; i++) {
      wires.encoder[motor][i] = pin(after(Parameter::pin_left_encoder_a, static_cast<uint8_t>(motor * hal::CHANNELS + i)));
    }
  }
  return wires;
}

}  // namespace

bool depends_on(Parameter parameter) {
  return parameter == Parameter::bridge || static_cast<uint8_t>(parameter) >= PIN_FIRST;
}

void begin() {
  const Bridge bridge = static_cast<Bridge>(config::get(Parameter::bridge));
  finding = check(config::pins(), bridge);
  in_force = bridge != Bridge::unset && finding.problem == WiringProblem::none;
  if (!in_force) return;
  hal::bridge_begin(wires(), bridge::rate(bridge), bridge::roles(bridge).pwm);
  if (pin(Parameter::i2c) > 0) bus::begin();
  sonar::begin();
  battery::begin();
}

void end() {
  hal::bridge_end();
  bus::end();
  sonar::end();
  in_force = false;
}

bool accepted() { return in_force; }

int8_t pin(Parameter parameter) { return static_cast<int8_t>(in_force ? config::get(parameter) : NOT_CONNECTED); }

void report() {
  writer::add(static_cast<int16_t>(finding.problem));
  writer::add(finding.parameter);
  writer::add(finding.other);
}

}  // namespace wiring
}  // namespace mrl

#endif
