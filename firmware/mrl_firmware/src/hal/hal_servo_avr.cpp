// Servos on outputs of timers with 16 bits, whose fast PWM makes the pulses without the program.
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE && !MRL_VIRTUAL
#include <avr/io.h>

#include "hal.h"
#include "hal_avr.h"

namespace hal {
namespace {

constexpr uint8_t COUNTS = 2;                                            // in 1 us, at F_CPU / 8
constexpr uint16_t PERIOD = 20000u * COUNTS, AFTER_ANY = 3000u * COUNTS;  // [count]

Output outputs[SERVOS];

}  // namespace

static volatile uint16_t& word(volatile uint8_t* at) { return *reinterpret_cast<volatile uint16_t*>(at); }

// ICRn can be written in modes with this TOP alone.
void servos_begin(const Wires& wires) {
  for (uint8_t i = 0; i < SERVOS; i++) {
    Output& output = outputs[i];
    if (wires.servo[i] < 0) continue;
    begin_output(output, wires.servo[i], true);
    output.control[0] = 0;
    output.control[1] = _BV(WGM13) | _BV(WGM12) | _BV(CS11);
    word(output.control + 6) = PERIOD - 1;
    output.control[0] = _BV(WGM11);
  }
}

void servos_end() {
  for (Output& output : outputs) {
    if (!output.mask) continue;
    output.control[0] = 0;
    output.control[1] = 0;
    output = Output();
  }
}

// The timer takes a new length over between two pulses.
void servo_write(uint8_t servo, uint16_t pulse) {
  const Output& output = outputs[servo];
  if (!output.mask) return;
  if (pulse) {
    word(output.compare) = static_cast<uint16_t>(pulse * COUNTS - 1);
    *output.control = *output.control | output.control_bit;
  } else if (word(output.control + 4) > AFTER_ANY) {
    *output.control = static_cast<uint8_t>(*output.control & ~output.control_bit);
  }
}

}  // namespace hal
#endif
