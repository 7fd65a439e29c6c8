// The clock of boards whose wiring may take timer 1: 64 us on whichever timer is free.  Other builds have timer 1 alone.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE
#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal.h"
#include "hal_avr.h"

namespace hal {

Clock clock;
volatile uint16_t clock_base;
const volatile uint8_t* clock_low = &TCNT1L;
uint16_t sample_due;
volatile uint8_t rounds_left;
static_assert(SAMPLE_TICKS % 2 == 0, "a round of timer 2 has two ticks");

// The alarms of timers with 16 bits are in hal_avr.cpp.
EMPTY_INTERRUPT(TIMER2_COMPA_vect);
EMPTY_INTERRUPT(TIMER0_COMPA_vect);

#define MRL_TEXT(name) #name
#define MRL_JUMP(vector) "jmp " MRL_TEXT(vector)

// A round of timer 2 next to its PWM, in 36 cycles every 128 us.  The last one before a sample goes on as its interrupt.
ISR(TIMER2_OVF_vect, ISR_NAKED) {
  asm volatile(
      "push r24                  \n\t"
      "in   r24, __SREG__        \n\t"
      "push r24                  \n\t"
      "lds  r24, %[base]         \n\t"
      "subi r24, 0xFE            \n\t"  // the base is even: its low byte becomes 0 if it overflows
      "sts  %[base], r24         \n\t"
      "brne 1f                   \n\t"
      "lds  r24, %[base]+1       \n\t"
      "inc  r24                  \n\t"
      "sts  %[base]+1, r24       \n\t"
      "1: lds r24, %[left]       \n\t"
      "dec  r24                  \n\t"
      "sts  %[left], r24         \n\t"
      "breq 2f                   \n\t"
      "pop  r24                  \n\t"
      "out  __SREG__, r24        \n\t"
      "pop  r24                  \n\t"
      "reti                      \n\t"
      "2: pop r24                \n\t"
      "out  __SREG__, r24        \n\t"
      "pop  r24                  \n\t"
      MRL_JUMP(TIMER1_COMPB_vect) ::[base] "i"(&clock_base),
      [left] "i"(&rounds_left));
}

// It runs when a wiring changes: small rather than fast.
#pragma GCC optimize("Os")

static void start_timer(uint16_t now) {
  switch (clock) {
#define MRL_START(n)                              \
  case Clock::timer##n:                           \
    TCCR##n##A = 0;                               \
    TCCR##n##B = _BV(CS12) | _BV(CS10); /* F_CPU / 1024 */ \
    TCNT##n = now;                                \
    TIFR##n = _BV(OCF1A) | _BV(OCF1B);            \
    TIMSK##n = _BV(OCIE1A) | _BV(OCIE1B);         \
    break;
    MRL_WIDE_TIMERS(MRL_START)
    case Clock::timer2:
      TCCR2A = 0;
      TCCR2B = _BV(CS22) | _BV(CS21) | _BV(CS20);  // F_CPU / 1024
      TCNT2 = static_cast<uint8_t>(now);
      TIFR2 = _BV(OCF2A) | _BV(OCF2B);
      TIMSK2 = _BV(OCIE2A) | _BV(OCIE2B);
      break;
    case Clock::timer0:
      TCCR0A = 0;
      TCCR0B = _BV(CS02) | _BV(CS00);  // F_CPU / 1024
      TCNT0 = static_cast<uint8_t>(now);
      TIFR0 = _BV(OCF0A) | _BV(OCF0B);
      TIMSK0 = _BV(OCIE0A) | _BV(OCIE0B);
      break;
    case Clock::pwm_timer2:
      TCCR2A = _BV(WGM21) | _BV(WGM20);  // fast PWM
      TCCR2B = _BV(CS21);                // F_CPU / 8: 2048 cycles a round
      TCNT2 = static_cast<uint8_t>(now & 1 ? 128 : 0);
      TIFR2 = _BV(TOV2);
      TIMSK2 = _BV(TOIE2);
      clock_base = now & 0xFFFE;
      break;
  }
}

void clock_use(Clock to) {
  if (clock == to) return;
  cli();
  const uint16_t now = clock_now();
#define MRL_SILENCE(n) TIMSK##n =
  TIMSK0 = MRL_WIDE_TIMERS(MRL_SILENCE) TIMSK2 = 0;
  clock = to;
#define MRL_LOW(n) to == Clock::timer##n ? &TCNT##n##L :
  clock_low = MRL_WIDE_TIMERS(MRL_LOW)
              to == Clock::timer2 ? &TCNT2
              : to == Clock::timer0 ? &TCNT0
                                    : reinterpret_cast<const volatile uint8_t*>(&clock_base);
  clock_base = now;
  start_timer(now);
  clock_plan_sample(static_cast<uint16_t>(now + SAMPLE_TICKS));  // a timer that has made PWM takes it at once now
  sei();
}

}  // namespace hal
#endif
