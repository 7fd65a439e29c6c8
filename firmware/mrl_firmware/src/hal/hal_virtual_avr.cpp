// The H-bridge of a robot that is calculated: no pin is touched.
#include "../../build.h"
#if defined(__AVR__) && MRL_VIRTUAL
#include <avr/interrupt.h>
#include <avr/io.h>

#include "../virtual/virtual_robot.h"
#include "hal.h"
#include "hal_avr.h"

namespace hal {

using namespace mrl;

namespace {

EncoderSample next;
volatile uint16_t due;
volatile bool is_due;
bool begun, under_way;

}  // namespace

void bridge_off() {
  const uint8_t off[BRIDGE_PINS] = {0, 0, 0, 0};
  for (uint8_t motor = 0; motor < MOTORS; motor++) virtual_robot::drive(motor, off);
}

void bridge_begin(const Wires&, PwmRate, uint8_t) { begun = true; }

void bridge_end() {
  bridge_off();
  begun = false;
}

void bridge_write(uint8_t motor, const uint8_t (&duties)[BRIDGE_PINS]) {
  if (begun && !missed_kicks) virtual_robot::drive(motor, duties);
}

// The clock stays on timer 1.
ISR(TIMER1_COMPB_vect) {
  due = clock_now();
  clock_took_sample(due);
  is_due = true;
  tell_loop();
}

bool encoder_sample(EncoderSample& sample) {
  if (is_due && !under_way) {
    cli();
    next.tick = due;
    is_due = false;
    sei();
    under_way = true;
  }
  if (!under_way) return false;
  tell_loop();
  if (!virtual_robot::step(next)) return false;
  under_way = false;
  sample = next;
  return true;
}

uint16_t encoder_read(uint16_t (&counts)[MOTORS]) { return virtual_robot::counts_at(ticks(), counts); }

uint16_t impossible_transitions() { return 0; }
bool encoder_masked(uint8_t) { return false; }
void encoder_unmask(uint8_t) {}
void encoder_single_channel(bool) {}
void servo_write(uint8_t, uint16_t) {}
bool range_fire(uint8_t, uint8_t) { return false; }
Echo range_echo(uint16_t&) { return Echo::none; }

void samples_begin() {
  clock_plan_sample(static_cast<uint16_t>(ticks() + SAMPLE_TICKS));
  TIFR1 = _BV(OCF1B);
  TIMSK1 |= _BV(OCIE1B);
}

}  // namespace hal
#endif
