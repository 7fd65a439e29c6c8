// An H-bridge on timers 0 and 2, and two encoders on the pin-change interrupts of ports D (left) and B (right).
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE
#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal.h"
#include "hal_avr.h"
#include "../../pins.h"
#include "../motors/quadrature.h"

namespace hal {
namespace {

using namespace mrl;

// ---- outputs

static_assert(pins::LEFT_PWM_A == 5 && pins::LEFT_PWM_B == 6 && pins::RIGHT_PWM_A == 11 && pins::RIGHT_PWM_B == 3,
              "the registers of the timers' outputs are written out below");
static_assert(chip::port(pins::LEFT_LOGIC) == chip::Port::d && chip::port(pins::RIGHT_LOGIC) == chip::Port::b,
              "the ports of the logic pins are written out below");

constexpr uint8_t OUTPUTS_D = chip::mask(pins::LEFT_PWM_A) | chip::mask(pins::LEFT_PWM_B) |
                              chip::mask(pins::LEFT_LOGIC) | chip::mask(pins::RIGHT_PWM_B);
constexpr uint8_t OUTPUTS_B = chip::mask(pins::RIGHT_PWM_A) | chip::mask(pins::RIGHT_LOGIC);
constexpr uint8_t OUTPUT_A = _BV(COM0A1), OUTPUT_B = _BV(COM0B1);  // of both timers
static_assert(OUTPUT_A == _BV(COM2A1) && OUTPUT_B == _BV(COM2B1) && _BV(WGM00) == _BV(WGM20) &&
                  _BV(WGM01) == _BV(WGM21) && _BV(CS00) == _BV(CS20) && _BV(CS01) == _BV(CS21),
              "timers 0 and 2 have the same bits");

bool fast_pwm;

}  // namespace

// The first instructions of the program.  Before them, resistors hold the inputs of the bridge low.
void hold_bridge_low() __attribute__((naked, used, section(".init3")));
void hold_bridge_low() {
  PORTD &= static_cast<uint8_t>(~OUTPUTS_D);
  PORTB &= static_cast<uint8_t>(~OUTPUTS_B);
  DDRD |= OUTPUTS_D;
  DDRB |= OUTPUTS_B;
}

// The ports go first: they take over when the timers let go.
void bridge_off() {
  const uint8_t status = SREG;
  cli();
  PORTD &= static_cast<uint8_t>(~OUTPUTS_D);
  PORTB &= static_cast<uint8_t>(~OUTPUTS_B);
  TCCR0A &= static_cast<uint8_t>(~(OUTPUT_A | OUTPUT_B));
  TCCR2A &= static_cast<uint8_t>(~(OUTPUT_A | OUTPUT_B));
  SREG = status;
}

void bridge_begin(PwmRate rate) {
  bridge_off();
  fast_pwm = rate == PwmRate::medium;
  TCCR0A = TCCR2A = static_cast<uint8_t>(_BV(WGM00) | (fast_pwm ? _BV(WGM01) : 0));
  TCCR0B = TCCR2B = rate == PwmRate::fast ? _BV(CS00) : _BV(CS01);  // F_CPU or F_CPU / 8
}

static inline void write_level(volatile uint8_t& port, uint8_t pin, bool high) {
  const uint8_t others = static_cast<uint8_t>(port & ~chip::mask(pin));
  port = high ? others | chip::mask(pin) : others;
}

// Fast PWM is high for one count more than its compare value.
static inline void write_pwm(volatile uint8_t& port, uint8_t pin, volatile uint8_t& control, uint8_t output,
                             volatile uint8_t& compare, uint8_t duty) {
  if (duty == 0 || duty == 255) {
    write_level(port, pin, duty);
    control &= static_cast<uint8_t>(~output);
  } else {
    compare = static_cast<uint8_t>(duty - fast_pwm);
    control = control | output;
  }
}

static inline void write_left(BridgePin pin, uint8_t duty) {
  if (pin == BridgePin::pwm_a) return write_pwm(PORTD, pins::LEFT_PWM_A, TCCR0A, OUTPUT_B, OCR0B, duty);
  if (pin == BridgePin::pwm_b) return write_pwm(PORTD, pins::LEFT_PWM_B, TCCR0A, OUTPUT_A, OCR0A, duty);
  write_level(PORTD, pins::LEFT_LOGIC, duty);
}

static inline void write_right(BridgePin pin, uint8_t duty) {
  if (pin == BridgePin::pwm_a) return write_pwm(PORTB, pins::RIGHT_PWM_A, TCCR2A, OUTPUT_A, OCR2A, duty);
  if (pin == BridgePin::pwm_b) return write_pwm(PORTD, pins::RIGHT_PWM_B, TCCR2A, OUTPUT_B, OCR2B, duty);
  write_level(PORTB, pins::RIGHT_LOGIC, duty);
}

void bridge_write(uint8_t motor, BridgePin pin, uint8_t duty) {
  cli();
  if (!missed_kicks) {
    if (motor) {
      write_right(pin, duty);
    } else {
      write_left(pin, duty);
    }
  }
  sei();
}

// ---- encoders

namespace {

constexpr uint8_t PINS_D = chip::mask(pins::LEFT_ENCODER_A) | chip::mask(pins::LEFT_ENCODER_B);
constexpr uint8_t PINS_B = chip::mask(pins::RIGHT_ENCODER_A) | chip::mask(pins::RIGHT_ENCODER_B);
constexpr uint8_t CHANGES[2] = {_BV(PCIE2), _BV(PCIE0)};

volatile uint16_t counts[2], edge_ticks[2], impossible;
volatile uint8_t edges_left[2];  // until the encoder's interrupt is masked
volatile int8_t steps[quadrature::INDICES] __attribute__((aligned(quadrature::INDICES)));

EncoderSample newest;
volatile bool is_new;

}  // namespace

// Counts one edge in 67 cycles with the entry, 69 for the left encoder.  The compiler's code takes 103: the interrupts
// must let the USB port, the other encoder and the sample have their turn at 100 000 edges/s.  The old state, already
// shifted, is in a register of the chip that needs no LDS.  Bit 0 of a step is set if it counts.
#define COUNT_EDGE(port, shift, encoder, old_state, change)                                               \
  asm volatile(                                                                                           \
      "push r24                       \n\t"                                                               \
      "in   r24, __SREG__             \n\t"                                                               \
      "push r24                       \n\t"                                                               \
      "push r30                       \n\t"                                                               \
      "push r31                       \n\t"                                                               \
      "in   r24, %[inputs]            \n\t" shift                                                         \
      "andi r24, %[channels]          \n\t"                                                               \
      "in   r30, %[state]             \n\t"                                                               \
      "or   r30, r24                  \n\t"                                                               \
      "lsl  r24                       \n\t"                                                               \
      "out  %[state], r24             \n\t"                                                               \
      "ori  r30, lo8(%[table])        \n\t"                                                               \
      "ldi  r31, hi8(%[table])        \n\t"                                                               \
      "ld   r30, Z                    \n\t"                                                               \
      "lds  r24, %[left]              \n\t"                                                               \
      "dec  r24                       \n\t"                                                               \
      "sts  %[left], r24              \n\t"                                                               \
      "breq 4f                        \n\t"                                                               \
      "1: sbrs r30, 0                 \n\t"                                                               \
      "rjmp 5f                        \n\t"                                                               \
      "mov  r31, r30                  \n\t"                                                               \
      "asr  r31                       \n\t"                                                               \
      "lds  r24, %[count]             \n\t"                                                               \
      "add  r24, r30                  \n\t"                                                               \
      "sts  %[count], r24             \n\t"                                                               \
      "lds  r24, %[count]+1           \n\t"                                                               \
      "adc  r24, r31                  \n\t"                                                               \
      "sts  %[count]+1, r24           \n\t"                                                               \
      "lds  r24, %[now]               \n\t"                                                               \
      "sts  %[tick], r24              \n\t"                                                               \
      "lds  r24, %[now]+1             \n\t"                                                               \
      "sts  %[tick]+1, r24            \n\t"                                                               \
      "3: pop r31                     \n\t"                                                               \
      "pop  r30                       \n\t"                                                               \
      "pop  r24                       \n\t"                                                               \
      "out  __SREG__, r24             \n\t"                                                               \
      "pop  r24                       \n\t"                                                               \
      "reti                           \n\t"                                                               \
      /* too many edges */                                                                                \
      "4: lds r24, %[enable]          \n\t"                                                               \
      "andi r24, %[others]            \n\t"                                                               \
      "sts  %[enable], r24            \n\t"                                                               \
      "sbi  %[news], 0                \n\t"                                                               \
      "rjmp 1b                        \n\t"                                                               \
      /* no step, or an impossible one */                                                                 \
      "5: sbrs r30, 1                 \n\t"                                                               \
      "rjmp 3b                        \n\t"                                                               \
      "lds  r30, %[wrong]             \n\t"                                                               \
      "lds  r31, %[wrong]+1           \n\t"                                                               \
      "adiw r30, 1                    \n\t"                                                               \
      "breq 3b                        \n\t"                                                               \
      "sts  %[wrong]+1, r31           \n\t"                                                               \
      "sts  %[wrong], r30             \n\t"                                                               \
      "rjmp 3b                        \n\t"                                                               \
      ::[inputs] "I"(_SFR_IO_ADDR(port)),                                                                 \
      [state] "I"(_SFR_IO_ADDR(old_state)), [channels] "M"(quadrature::CHANNELS), [table] "i"(steps),     \
      [left] "i"(&edges_left[encoder]), [count] "i"(&counts[encoder]), [tick] "i"(&edge_ticks[encoder]),  \
      [now] "i"(_SFR_MEM_ADDR(TCNT1)), [wrong] "i"(&impossible),                                          \
      [enable] "i"(_SFR_MEM_ADDR(PCICR)), [others] "M"(0xFF & ~(change)),                                 \
      [news] "I"(_SFR_IO_ADDR(GPIOR0)))

static_assert(chip::bit_of(pins::LEFT_ENCODER_A) == 2 && chip::bit_of(pins::RIGHT_ENCODER_A) == 0, "the shifts below");
static_assert((quadrature::IMPOSSIBLE & 3) == 2, "bits 0 and 1 tell a step from an impossible one");

ISR(PCINT2_vect, ISR_NAKED) { COUNT_EDGE(PIND, "lsr r24\n\tlsr r24\n\t", 0, GPIOR1, _BV(PCIE2)); }
ISR(PCINT0_vect, ISR_NAKED) { COUNT_EDGE(PINB, "", 1, GPIOR2, _BV(PCIE0)); }

// The compare unit flags the end of its tick, so that at least one whole tick must lie ahead.  After a longer time without
// interrupts the next sample would come in the timer's next round, 4 s later: the cadence then starts again.
ISR(TIMER1_COMPB_vect) {
  newest.count[0] = counts[0];
  newest.count[1] = counts[1];
  newest.edge_tick[0] = edge_ticks[0];
  newest.edge_tick[1] = edge_ticks[1];
  edges_left[0] = edges_left[1] = MOST_EDGES;
  const uint16_t now = TCNT1, last = OCR1B;
  newest.tick = now;
  const bool in_time = static_cast<uint16_t>(now - last) < SAMPLE_TICKS;
  OCR1B = static_cast<uint16_t>((in_time ? last : now) + SAMPLE_TICKS);
  is_new = true;
  tell_loop();
}

// A sample that comes during the copy makes it again.
bool encoder_sample(EncoderSample& sample) {
  if (!is_new) return false;
  do {
    is_new = false;
    asm volatile("" ::: "memory");
    sample = newest;
    asm volatile("" ::: "memory");
  } while (is_new);
  return true;
}

void encoder_read(EncoderSample& sample) {
  cli();
  for (uint8_t i = 0; i < 2; i++) {
    sample.count[i] = counts[i];
    sample.edge_tick[i] = edge_ticks[i];
  }
  sample.tick = TCNT1;
  sei();
}

uint16_t impossible_transitions() {
  cli();
  const uint16_t count = impossible;
  sei();
  return count;
}

bool encoder_masked(uint8_t encoder) { return !(PCICR & CHANGES[encoder]); }

// Goes on from the present state.  An edge after the flag is cleared interrupts, even one before the state is read.
void encoder_unmask(uint8_t encoder) {
  cli();
  PCIFR = CHANGES[encoder];
  if (encoder) {
    GPIOR2 = static_cast<uint8_t>((PINB & quadrature::CHANNELS) << 1);
  } else {
    GPIOR1 = static_cast<uint8_t>((PIND >> chip::bit_of(pins::LEFT_ENCODER_A) & quadrature::CHANNELS) << 1);
  }
  PCICR = PCICR | CHANGES[encoder];
  sei();
}

void encoder_single_channel(bool on) {
  cli();
  for (uint8_t i = 0; i < quadrature::INDICES; i++) steps[i] = on ? quadrature::single_step(i) : quadrature::step(i);
  PCMSK2 = on ? chip::mask(pins::LEFT_ENCODER_A) : PINS_D;
  PCMSK0 = on ? chip::mask(pins::RIGHT_ENCODER_A) : PINS_B;
  sei();
}

// Pull-ups hold the lines of encoders with open collectors, and those of a broken wire.  The encoders' interrupts come
// last: their reads of timer 1 use the byte through which a compare value is written.
void encoders_begin() {
  PORTD |= PINS_D;
  PORTB |= PINS_B;
  OCR1B = static_cast<uint16_t>(ticks() + SAMPLE_TICKS);
  TIFR1 = _BV(OCF1B);
  TIMSK1 |= _BV(OCIE1B);
  edges_left[0] = edges_left[1] = MOST_EDGES;
  encoder_single_channel(false);
  encoder_unmask(0);
  encoder_unmask(1);
}

}  // namespace hal
#endif
