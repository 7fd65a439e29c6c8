// Functions that the files of the AVR's hardware layer share.
#pragma once
#include <avr/io.h>

#include "../../build.h"
#include "hal.h"

namespace hal {

// For interrupts: wakes the loop.  One instruction that changes no register and no flag.
inline void tell_loop() { GPIOR0 |= _BV(0); }
inline bool has_news() { return GPIOR0 & _BV(0); }

// Number of watchdog periods since the last kick.
extern volatile uint8_t missed_kicks;

// ---- the clock, for code that interrupts do not interrupt

#if MRL_BRIDGE
// Its timer.  Timers 2 and 0 count the low byte of the ticks; the last sample, at most 255 ticks ago, has the high byte.
// If all timers make PWM, timer 2 is the clock next to its PWM: a round has two ticks, and its interrupt counts them.
enum class Clock : uint8_t { timer1, timer2, timer0, pwm_timer2 };
extern Clock clock;                          // only clock_use() changes it
extern volatile uint16_t clock_base;         // tick of the last sample, or of the beginning of timer 2's round
extern const volatile uint8_t* clock_low;    // low byte of the ticks; next to PWM of the even ones
extern uint16_t sample_due;                  // tick
extern volatile uint8_t rounds_left;         // of timer 2 next to its PWM, until the sample

// Continues on another timer, at most one tick late.
void clock_use(Clock to);

inline uint16_t clock_now() {
  if (clock == Clock::timer1) return TCNT1;
  const uint16_t base = clock_base;
  if (clock == Clock::pwm_timer2) {
    const uint8_t count = TCNT2;
    const bool passed = (TIFR2 & _BV(TOV2)) && count < 128;  // the round's interrupt is still pending
    return static_cast<uint16_t>(base + (count >> 7) + (passed ? 2 : 0));
  }
  const uint8_t count = clock == Clock::timer2 ? TCNT2 : TCNT0;
  return static_cast<uint16_t>(base + static_cast<uint8_t>(count - static_cast<uint8_t>(base)));
}

// Plans the next interrupt of the sample.
inline void clock_plan_sample(uint16_t tick) {
  sample_due = tick;
  if (clock == Clock::timer1) {
    OCR1B = tick;
  } else if (clock == Clock::timer2) {
    OCR2B = static_cast<uint8_t>(tick);
  } else if (clock == Clock::timer0) {
    OCR0B = static_cast<uint8_t>(tick);
  } else {
    rounds_left = static_cast<uint8_t>(static_cast<uint16_t>(tick - clock_base) / 2);
  }
}

// In the interrupt of the sample.
inline void clock_took_sample(uint16_t now) {
  const bool in_time = static_cast<uint16_t>(now - sample_due) < SAMPLE_TICKS;
  if (clock != Clock::pwm_timer2) clock_base = now;
  clock_plan_sample(static_cast<uint16_t>((in_time ? sample_due : now) + SAMPLE_TICKS));
}

// Wakes the chip at the end of a tick.  Any interrupt does; timer 2 next to its PWM has one every two ticks.
inline void clock_set_alarm(uint16_t tick) {
  if (clock == Clock::timer1) {
    OCR1A = tick;
    TIFR1 = _BV(OCF1A);
  } else if (clock == Clock::timer2) {
    OCR2A = static_cast<uint8_t>(tick);
    TIFR2 = _BV(OCF2A);
  } else if (clock == Clock::timer0) {
    OCR0A = static_cast<uint8_t>(tick);
    TIFR0 = _BV(OCF0A);
  }
}
#else
inline uint16_t clock_now() { return TCNT1; }
inline void clock_set_alarm(uint16_t tick) {
  OCR1A = tick;
  TIFR1 = _BV(OCF1A);
}
#endif

// Needs the running clock.
void bus_begin();
void dust_begin();
void samples_begin();

}  // namespace hal
