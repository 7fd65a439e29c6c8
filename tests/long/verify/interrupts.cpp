// Calls one function of the hardware layer at a time, as the emulator's host orders it through `order`.  Linked with the firmware's
// hal_*.cpp and its compiler options.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <string.h>

#include "build.h"
#include "src/hal/hal.h"

extern "C" {
volatile char order;
volatile uint8_t busy, finished;
volatile uint8_t argument[4];
volatile uint8_t result[20];
}

namespace {

template <typename Value>
void answer(const Value& value) {
  uint8_t bytes[sizeof value];
  memcpy(bytes, &value, sizeof value);
  for (uint8_t i = 0; i < sizeof value; i++) result[i] = bytes[i];
}

uint16_t word() { return static_cast<uint16_t>(argument[0] | argument[1] << 8); }

void carry_out(char what) {
  switch (what) {
    case 't':
      return answer(hal::ticks());
    case 'r':
      return answer(hal::serial_read());
    case 'w':
      return hal::serial_write(argument[0]);
    case 'o':
      return answer(hal::serial_overruns());
    case 'd':
      return hal::serial_discard();
    case 'n':
      return answer(hal::take_news());
    case 's':
      return hal::sleep_until(word());
    case 'k':
      return hal::watchdog_kick();
    case 'j':  // shifts the calls that follow against the chip's other clocks
      for (uint8_t i = argument[0]; i; i--) asm volatile("");
      return;
    case 'p':
      return hal::pin_output(argument[0], argument[1]);
#if MRL_BRIDGE
    case 'e': {
      uint16_t counts[hal::MOTORS];
      hal::encoder_read(counts);
      return answer(counts);
    }
    case 'S': {
      struct {
        hal::EncoderSample sample;
        bool is_new;
      } both;
      memset(&both, 0, sizeof both);
      both.is_new = hal::encoder_sample(both.sample);
      return answer(both);
    }
    case 'i':
      return answer(hal::impossible_transitions());
    case 'u':
      return hal::encoder_unmask(argument[0]);
    case 'b': {
      const uint8_t duties[] = {argument[1], argument[2], argument[3], 0};
      return hal::bridge_write(argument[0], duties);
    }
#endif
#if MRL_XBEE
    case 'W':
      return hal::radio_write(argument[0]);
#endif
#if MRL_ENVIRONMENT
    case 'l':
      return answer(hal::dust_low_ticks());
    case 'c':
      return answer(hal::dust_changed());
#endif
  }
}

}  // namespace

int main() {
  hal::begin();
#if MRL_BRIDGE
  const hal::Wires duo = {{{5, 6, 7, -1}, {11, 3, 9, -1}}, {{2, 4}, {8, 10}}, {-1, -1}};
  hal::bridge_begin(duo, hal::PwmRate::medium, 3);  // PWM on pwm_a and pwm_b
#endif
#if MRL_XBEE
  hal::radio_begin();
#endif
  for (;;) {
    while (!order) {
    }
    const char what = order;
    busy = 1;
    order = 0;
    carry_out(what);
    busy = 0;
    finished++;
  }
}
