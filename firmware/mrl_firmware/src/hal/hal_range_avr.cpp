// Echoes of HC-SR04 on pin-change or external interrupts, timed by a timer that counts 0.5 us.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE && !MRL_VIRTUAL
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/delay.h>

#include "chip.h"
#include "hal.h"
#include "hal_avr.h"

namespace hal {
namespace {

constexpr uint16_t LONGEST_TICKS = 480;  // 30.7 ms; 0.5 us wrap after 32.8 ms
constexpr double TRIGGER_US = 10;

const volatile uint8_t* fine = &TCNT0;  // 0.5 us; it and the ticks count together, 128 of them a tick
volatile uint8_t *inputs = &PINB, *enables = &PCMSK0;  // of the echo
uint8_t echo_mask, enable_mask;                         // its bits there
volatile uint8_t echo_level;                            // 0, or its bit of its port
volatile Echo state;
uint16_t begun_tick, begun;
volatile uint16_t length;

// Time in 0.5 us.  The two registers are read one after the other: the fine one decides which tick it is.
inline uint16_t fine_time(uint16_t tick) {
  const uint16_t middle = static_cast<uint16_t>(tick * 128 + 64);
  return static_cast<uint16_t>(middle + static_cast<int8_t>(*fine - static_cast<uint8_t>(middle)));
}

__attribute__((noinline)) void echo_changed() {
  const uint16_t tick = clock_now(), time = fine_time(tick);
  if (echo_level) {
    begun_tick = tick;
    begun = time;
    state = Echo::high;
    return;
  }
  const bool is_long = static_cast<uint16_t>(tick - begun_tick) > LONGEST_TICKS;
  length = is_long ? LONG_ECHO : static_cast<uint16_t>(time - begun);
  state = Echo::over;
  *enables = static_cast<uint8_t>(*enables & ~enable_mask);
  tell_loop();
}

}  // namespace

// The echo may be one of several pins that have changed, or none.
void echo_edge() __attribute__((naked, used));
void echo_edge() {
  asm volatile(
      "push r25                  \n\t"
      MRL_SAVE_STATUS_AND_Z
      "lds  r30, %[inputs]       \n\t"
      "lds  r31, %[inputs]+1     \n\t"
      "ld   r25, Z               \n\t"
      "lds  r30, %[mask]         \n\t"
      "and  r25, r30             \n\t"
      "lds  r30, %[level]        \n\t"
      "cp   r25, r30             \n\t"
      "breq 1f                   \n\t"
      "sts  %[level], r25        \n\t"
      "push r0                   \n\t"
      "push r1                   \n\t"
      "push r18                  \n\t"
      "push r19                  \n\t"
      "push r20                  \n\t"
      "push r21                  \n\t"
      "push r22                  \n\t"
      "push r23                  \n\t"
      "push r24                  \n\t"
      "push r26                  \n\t"
      "push r27                  \n\t"
      "clr  r1                   \n\t"
      "call %x[changed]          \n\t"
      "pop  r27                  \n\t"
      "pop  r26                  \n\t"
      "pop  r24                  \n\t"
      "pop  r23                  \n\t"
      "pop  r22                  \n\t"
      "pop  r21                  \n\t"
      "pop  r20                  \n\t"
      "pop  r19                  \n\t"
      "pop  r18                  \n\t"
      "pop  r1                   \n\t"
      "pop  r0                   \n"
      "1:                        \n\t"
      MRL_RESTORE_STATUS_AND_Z
      "ret                       \n\t" ::[inputs] "i"(&inputs), [mask] "i"(&echo_mask),
      [level] "i"(&echo_level), [changed] "i"(echo_changed));
}

// ---- what follows runs 16 times a second, or when a wiring changes: small rather than fast
#pragma GCC optimize("Os")

// The interrupt of the last echo is that of encoders alone again.
static void watch_none() {
  *enables = static_cast<uint8_t>(*enables & ~enable_mask);
  GPIOR0 &= _BV(0);
  PCICR = encoder_groups();
}

void ranges_end() {
  const uint8_t status = SREG;
  cli();
  watch_none();
  enable_mask = 0;
  SREG = status;
}

static void watch(uint8_t pin) {
  const mrl::chip::Functions functions = mrl::chip::functions(static_cast<int8_t>(pin));
  const uint8_t change = static_cast<uint8_t>(functions.change);
  const uint8_t group = MRL_MEGA && functions.change < 0 ? EXTERNAL_INTERRUPTS : change / 8;
  cli();
  watch_none();
  inputs = registers_of(mrl::chip::port(pin));
  echo_mask = mrl::chip::mask(pin);
  enables = &PCMSK0 + group;
  enable_mask = static_cast<uint8_t>(1 << (change & 7));
#if MRL_MEGA
  if (group == EXTERNAL_INTERRUPTS) {
    const uint8_t number = static_cast<uint8_t>(functions.external);
    enables = &EIMSK;
    enable_mask = static_cast<uint8_t>(1 << number);
    sense_edges(number);
  }
#endif
  echo_level = 0;
  state = Echo::none;
  *enables = *enables | enable_mask;
  GPIOR0 = static_cast<uint8_t>(GPIOR0 | 1 << AWAITED_ECHO(group));
  if (!MRL_MEGA) PCICR = static_cast<uint8_t>(PCICR | 1 << group);  // a Mega has all groups
  sei();
}

bool range_fire(uint8_t trigger, uint8_t echo) {
  if (*registers_of(mrl::chip::port(echo)) & mrl::chip::mask(echo)) return false;
  watch(echo);
  volatile uint8_t& toggles = *registers_of(mrl::chip::port(trigger));
  toggles = mrl::chip::mask(trigger);
  _delay_us(TRIGGER_US);
  toggles = mrl::chip::mask(trigger);
  return true;
}

// The state goes first: once the echo is over, no interrupt changes its length.
Echo range_echo(uint16_t& to) {
  const Echo now = state;
  to = length;
  return now;
}

// Timer 0 unless it is the clock, or makes PWM while timer 2 does nothing.  Medium PWM counts 0.5 us in rounds of two
// ticks, as a timer does that makes none.
static bool uses_timer2(uint8_t timers) {
  const bool is_free = !(timers & 4) && clock != Clock::timer2;
  return clock == Clock::timer0 || clock == Clock::pwm_timer2 || ((timers & 1) && is_free);
}

bool ranges_need_pwm(uint8_t timers) { return timers & (uses_timer2(timers) ? 4 : 1); }

void ranges_begin(uint8_t timers) {
  const bool second = uses_timer2(timers);
  volatile uint8_t& count = second ? TCNT2 : TCNT0;
  fine = &count;
  if (!(timers & (second ? 4 : 1))) {
    (second ? TCCR2A : TCCR0A) = 0;
    (second ? TCCR2B : TCCR0B) = _BV(CS01);  // F_CPU / 8
  }
  if (clock == Clock::pwm_timer2) return;  // the ticks are its counts
  cli();
  const uint16_t before = clock_now();
  uint16_t now = before;
  while (now == before) now = clock_now();
  count = static_cast<uint8_t>(now & 1 ? 128 : 0);
  sei();
}

}  // namespace hal
#endif
