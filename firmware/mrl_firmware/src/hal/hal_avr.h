// Functions that the files of the AVR's hardware layer share.
#pragma once
#include <avr/io.h>

#include "../../build.h"
#include "chip.h"
#include "hal.h"

namespace hal {

// For interrupts: wakes the loop.  One instruction that changes no register and no flag.
inline __attribute__((always_inline)) void tell_loop() { GPIOR0 |= _BV(0); }
inline bool has_news() { return GPIOR0 & _BV(0); }
// Bit of GPIOR0: an echo is awaited in this group of pins, which share a pin-change interrupt, or on any external one.
#define AWAITED_ECHO(group) (1 + (group))
#define EXTERNAL_INTERRUPTS 3

// Number of watchdog periods since the last kick.
extern volatile uint8_t missed_kicks;

// PIN, DDR and PORT of a port, which stand together.  Ports H to L of the Mega are beyond the I/O space.
inline volatile uint8_t* registers_of(mrl::chip::Port port) {
  const uint8_t number = static_cast<uint8_t>(port);
#if MRL_MEGA
  constexpr uint8_t H = static_cast<uint8_t>(mrl::chip::Port::h);
  return number < H ? &PINA + 3 * number : &PINH + 3 * (number - H);
#else
  return &PINB + 3 * number;
#endif
}

// ---- the clock, for code that interrupts do not interrupt

#if MRL_BRIDGE
// The timers with 16 bits that it may have.
#if MRL_MEGA
#define MRL_WIDE_TIMERS(OF) OF(1) OF(3) OF(4) OF(5)
#else
#define MRL_WIDE_TIMERS(OF) OF(1)
#endif

// Its timer.  Timers 2 and 0 count the low byte of the ticks; the last sample, at most 255 ticks ago, has the high byte.
// If all timers make PWM, timer 2 is the clock next to its PWM: a round has two ticks, and its interrupt counts them.
#define MRL_CLOCK(n) timer##n,
enum class Clock : uint8_t { MRL_WIDE_TIMERS(MRL_CLOCK) timer2, timer0, pwm_timer2 };
extern Clock clock;                          // only clock_use() changes it
extern volatile uint16_t clock_base;         // tick of the last sample, or of the beginning of timer 2's round
extern const volatile uint8_t* clock_low;    // low byte of the ticks; next to PWM of the even ones
extern uint16_t sample_due;                  // tick
extern volatile uint8_t rounds_left;         // of timer 2 next to its PWM, until the sample

// Continues on another timer, at most one tick late.
void clock_use(Clock to);

inline uint16_t clock_now() {
#define MRL_NOW(n) if (clock == Clock::timer##n) return TCNT##n;
  MRL_WIDE_TIMERS(MRL_NOW)
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
#define MRL_SET_SAMPLE(n) if (clock == Clock::timer##n) { OCR##n##B = tick; } else
  MRL_WIDE_TIMERS(MRL_SET_SAMPLE)
  if (clock == Clock::timer2) {
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
#define MRL_SET_ALARM(n) if (clock == Clock::timer##n) { OCR##n##A = tick; TIFR##n = _BV(OCF##n##A); } else
  MRL_WIDE_TIMERS(MRL_SET_ALARM)
  if (clock == Clock::timer2) {
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

// Bits of PCICR that are set anyway.
uint8_t encoder_groups();
// With the timers that make PWM, a bit each, once the clock runs: whether echoes are timed by one of them.
bool ranges_need_pwm(uint8_t timers);
// Begins that, after those timers.
void ranges_begin(uint8_t timers);
// Forgets the pin of the last echo, before its interrupt becomes another one's.
void ranges_end();
#if MRL_MEGA
// Lets each edge bring this external interrupt.
inline void sense_edges(uint8_t number) {
  volatile uint8_t& sense = number < 4 ? EICRA : EICRB;
  sense = static_cast<uint8_t>(sense | 1 << 2 * (number & 3));
}
#endif
// In a pin-change interrupt, before edges of encoders are counted; it saves all registers.
void echo_edge();
// Begin and end of an interrupt that uses r25, which has been saved, and Z.
#define MRL_SAVE_STATUS_AND_Z    "in r25, __SREG__\n\t push r25\n\t push r30\n\t push r31\n\t"
#define MRL_RESTORE_STATUS_AND_Z "pop r31\n\t pop r30\n\t pop r25\n\t out __SREG__, r25\n\t pop r25\n\t"

// Needs the running clock.
void bus_begin();
void dust_begin();
void samples_begin();

// Without a mask the output is not connected, without a bit in a control register it carries no PWM.
struct Output {
  volatile uint8_t* port;
  volatile uint8_t* control;
  volatile uint8_t* compare;  // of 16 bits the low byte
  uint8_t mask, control_bit;
};
// Makes an output of a pin, low, until bridge_off() or bridge_end().
void begin_output(Output& output, int8_t pin, bool has_pwm);
// TCCRnA, which TCCRnB follows; of 16 bits, TCNTn is 4 behind it, ICRn 6, and OCRnA 8.
volatile uint8_t* control_of(uint8_t timer);
void servos_begin(const Wires& wires);
void servos_end();

}  // namespace hal
