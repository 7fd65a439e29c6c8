#include "../../build.h"

#if MRL_BRIDGE

#include "servo.h"

#include "../serial/answers.h"
#include "../board/board_clock.h"
#include "../board/config.h"
#include "../board/failsafe.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../serial/protocol.h"
#include "../board/status.h"
#include "../board/wiring.h"

namespace mrl {
namespace servo {
namespace {

constexpr uint8_t SHIFT = 4;
constexpr uint16_t STEP = 244;  // ticks: 1/64 s, so that a speed of 4 us/s is a change of 1/16 us in a step

struct Servo {
  uint16_t present, target;  // [us/16]; 0: without pulses
  uint16_t change;           // in a step [us/16]
};
Servo servos[hal::SERVOS];
uint32_t since;
bool any;  // servo is connected

bool connected(uint8_t index) { return wiring::servo_pin(index) != NOT_CONNECTED; }

void step(Servo& servo) {
  const bool up = servo.target > servo.present;
  uint16_t left = static_cast<uint16_t>(up ? servo.target - servo.present : servo.present - servo.target);
  if (left > servo.change) left = servo.change;
  servo.present = static_cast<uint16_t>(up ? servo.present + left : servo.present - left);
}

// The host has been silent for long: servos stay where they are or lose their pulses, as configured.
void lose_host() {
  for (Servo& servo : servos) {
    if (config::get(Parameter::servo_release)) servo.present = 0;
    servo.target = servo.present;
  }
}

}  // namespace

void begin() {
  any = false;
  for (uint8_t i = 0; i < hal::SERVOS; i++) {
    servos[i] = Servo();
    any = any || connected(i);
  }
  since = board_clock::now();
}

void service() {
  if (!any || !board_clock::passed(since, STEP)) return;
  since += STEP;
  if (failsafe::host_lost()) lose_host();
  for (uint8_t i = 0; i < hal::SERVOS; i++) {
    step(servos[i]);
    hal::servo_write(i, servos[i].present >> SHIFT);
  }
}

void report(int16_t number) {
  writer::add(number);
  writer::add(static_cast<int16_t>(servos[number - 1].present >> SHIFT));
}

}  // namespace servo

namespace handlers {

void set_servo(const int16_t* args, uint8_t) {
  const uint8_t index = static_cast<uint8_t>(args[0] - 1);
  if (index >= hal::SERVOS || !servo::connected(index)) return status::refuse(Reason::unavailable);
  servo::Servo& servo = servo::servos[index];
  servo.target = static_cast<uint16_t>(args[1] << servo::SHIFT);
  servo.change = static_cast<uint16_t>((static_cast<uint16_t>(args[2]) + 3u) / 4);
  if (!args[2] || !servo.present) servo.present = servo.target;
  answers::ask(SET_SERVO, args[0]);
}

}  // namespace handlers
}  // namespace mrl

#endif
