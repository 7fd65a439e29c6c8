// Measures the dust sensor's low pulses with timer 1's input capture on D8.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_ENVIRONMENT
#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal.h"
#include "hal_avr.h"

namespace hal {
namespace {

volatile uint32_t low_ticks;
volatile uint16_t fell_at;
volatile bool dust_low;
volatile bool dust_edge;

}  // namespace

// Timer 1 latches the tick of each edge, so that the pulse is exact even if the interrupt is late.
ISR(TIMER1_CAPT_vect) {
  const uint16_t at = ICR1;
  dust_edge = true;
  if (TCCR1B & _BV(ICES1)) {  // rose
    if (dust_low) low_ticks += static_cast<uint16_t>(at - fell_at);
    dust_low = false;
  } else {
    fell_at = at;
    dust_low = true;
  }
  TCCR1B ^= _BV(ICES1);
  TIFR1 = _BV(ICF1);
}

uint32_t dust_low_ticks() {
  cli();
  const uint16_t now = TCNT1;
  if (dust_low) {
    low_ticks += static_cast<uint16_t>(now - fell_at);
    fell_at = now;
  }
  const uint32_t sum = low_ticks;
  low_ticks = 0;
  sei();
  return sum;
}

// An edge between the look and the clearing is reported now.
bool dust_changed() {
  if (!dust_edge) return false;
  dust_edge = false;
  return true;
}

void dust_begin() {
  TCCR1B = static_cast<uint8_t>((TCCR1B | _BV(ICNC1)) & ~_BV(ICES1));
  TIFR1 = _BV(ICF1);
  TIMSK1 |= _BV(ICIE1);
}

}  // namespace hal
#endif
