// H-bridges on the outputs of timers 0, 1 and 2, and two encoders on pin-change interrupts of any ports.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE
#include <avr/interrupt.h>
#include <avr/io.h>

#include "chip.h"
#include "flash.h"
#include "hal.h"
#include "hal_avr.h"
#include "../motors/quadrature.h"

namespace hal {
namespace {

using namespace mrl;

constexpr uint8_t PORTS = 3;  // B, C, D
constexpr uint8_t ALL = 0xFF;

bool is_connected(int8_t pin) { return pin >= 0; }

uint8_t port_of(int8_t pin) { return static_cast<uint8_t>(chip::port(static_cast<uint8_t>(pin))); }

uint8_t mask_of(int8_t pin) { return chip::mask(static_cast<uint8_t>(pin)); }

// PIN, DDR and PORT of a port stand together.
volatile uint8_t* registers_of(uint8_t port) { return &PINB + 3 * port; }

// ---- outputs

constexpr uint8_t OUTPUT_A = _BV(COM0A1), OUTPUT_B = _BV(COM0B1);  // of all timers
static_assert(OUTPUT_A == _BV(COM2A1) && OUTPUT_B == _BV(COM2B1) && OUTPUT_A == _BV(COM1A1) && OUTPUT_B == _BV(COM1B1) &&
                  _BV(WGM00) == _BV(WGM20) && _BV(WGM01) == _BV(WGM21) && _BV(WGM00) == _BV(WGM10) &&
                  _BV(CS00) == _BV(CS20) && _BV(CS01) == _BV(CS21) && _BV(CS00) == _BV(CS10) && _BV(CS01) == _BV(CS11),
              "the timers have the same bits");

struct Timer {
  volatile uint8_t* control;
  volatile uint8_t* compare[2];  // of timer 1 the low bytes; the high ones stay 0
};
constexpr uint8_t TIMERS = 3;
const Timer TIMER[TIMERS] = {
    {&TCCR0A, {&OCR0A, &OCR0B}}, {&TCCR1A, {&OCR1AL, &OCR1BL}}, {&TCCR2A, {&OCR2A, &OCR2B}}};

// Without a mask the output is not connected, without a bit in a control register it carries no PWM.
struct Output {
  volatile uint8_t* port;
  volatile uint8_t* control;
  volatile uint8_t* compare;
  uint8_t mask, control_bit;
};
Output outputs[MOTORS][BRIDGE_PINS];

// What is left of the registers when all outputs are off.
uint8_t port_rests[PORTS] = {ALL, ALL, ALL}, timer_rests[TIMERS] = {ALL, ALL, ALL};

bool fast_pwm;

}  // namespace

// The ports go first: they take over when the timers let go.
void bridge_off() {
  const uint8_t status = SREG;
  cli();
  PORTB &= port_rests[0];
  PORTC &= port_rests[1];
  PORTD &= port_rests[2];
  TCCR0A &= timer_rests[0];
  TCCR1A &= timer_rests[1];
  TCCR2A &= timer_rests[2];
  SREG = status;
}

static inline void write(const Output& output, uint8_t duty) {
  const uint8_t mask = output.mask, bit = output.control_bit;
  if (!mask) return;
  if (bit && duty != 0 && duty != 255) {
    *output.compare = static_cast<uint8_t>(duty - fast_pwm);  // fast PWM is high for one count more
    *output.control = *output.control | bit;
    return;
  }
  volatile uint8_t& port = *output.port;
  port = duty ? port | mask : static_cast<uint8_t>(port & ~mask);
  if (bit) *output.control = static_cast<uint8_t>(*output.control & ~bit);
}

void bridge_write(uint8_t motor, const uint8_t (&duties)[BRIDGE_PINS]) {
  const Output* output = outputs[motor] + BRIDGE_PINS;
  const uint8_t* duty = duties + BRIDGE_PINS;
  cli();
  if (!missed_kicks) {
    for (uint8_t left = BRIDGE_PINS; left; left--) write(*--output, *--duty);
  }
  sei();
}

// ---- encoders

namespace {

// A channel that is not connected reads as low: it has no mask.
struct Channel {
  uint8_t inputs;  // address of the port's register
  uint8_t mask;
};
Channel channels[MOTORS][CHANNELS];
typedef void Handler();
uint8_t changes[MOTORS];  // interrupts of an encoder: bits of PCICR
uint8_t others[MOTORS];   // those that are left when it is masked
Handler* handlers[PORTS];  // of the interrupts

volatile uint16_t counts[MOTORS], impossible;
volatile uint8_t edge_ticks[MOTORS];  // low bytes
volatile int8_t stepped[MOTORS];      // not 0: since the last sample
volatile uint8_t edges_left[MOTORS];  // until the encoder's interrupt is masked
volatile int8_t steps[MOTORS][quadrature::INDICES] __attribute__((aligned(quadrature::INDICES)));

EncoderSample newest;
volatile bool is_new;

}  // namespace

// An interrupt reads its port and finds the port's handler, which counts an edge in 87 cycles with the entry if both
// channels are on that port.  The compiler's code takes twice as long: the interrupts must let the USB port, the other
// encoder and the sample have their turn at 50 000 edges/s.  The old state is in a register of the chip that needs no LDS.
// NEG sets the carry if a channel is high.  Bit 0 of a step is set if it counts.
#define TO_HANDLER(port, inputs_of_port)        \
  asm volatile(                                 \
      "push r24                       \n\t"     \
      "in   r24, %[inputs]            \n\t"     \
      "push r30                       \n\t"     \
      "push r31                       \n\t"     \
      "lds  r30, %[handler]           \n\t"     \
      "lds  r31, %[handler]+1         \n\t"     \
      "ijmp                           \n\t" ::[handler] "i"(&handlers[port]), \
      [inputs] "I"(_SFR_IO_ADDR(inputs_of_port)))

#define BEGIN_EDGE(encoder)                                                                  \
  asm volatile(                                                                              \
      "push r25                       \n\t"                                                  \
      "in   r25, __SREG__             \n\t"                                                  \
      "push r25                       \n\t"                                                  \
      "lds  r25, %[left]              \n\t"                                                  \
      "dec  r25                       \n\t"                                                  \
      "sts  %[left], r25              \n\t"                                                  \
      "brne 1f                        \n\t" /* otherwise there are too many edges */         \
      "lds  r30, %[enable]            \n\t"                                                  \
      "lds  r31, %[others]            \n\t"                                                  \
      "and  r30, r31                  \n\t"                                                  \
      "sts  %[enable], r30            \n\t"                                                  \
      "sbi  %[news], 0                \n\t"                                                  \
      "1:                             \n\t" ::[left] "i"(&edges_left[encoder]),              \
      [others] "i"(&others[encoder]), [enable] "i"(_SFR_MEM_ADDR(PCICR)), [news] "I"(_SFR_IO_ADDR(GPIOR0)))

// The index of the step is in r30.
#define READ_THIS_PORT(encoder, old_state)                                                   \
  asm volatile(                                                                              \
      "lds  r25, %[a]+1               \n\t"                                                  \
      "and  r25, r24                  \n\t"                                                  \
      "neg  r25                       \n\t"                                                  \
      "in   r30, %[state]             \n\t"                                                  \
      "rol  r30                       \n\t"                                                  \
      "lds  r25, %[b]+1               \n\t"                                                  \
      "and  r25, r24                  \n\t"                                                  \
      "neg  r25                       \n\t"                                                  \
      "rol  r30                       \n\t" ::[a] "i"(&channels[encoder][0]),                \
      [b] "i"(&channels[encoder][1]), [state] "I"(_SFR_IO_ADDR(old_state)))

#define READ_ANY_PORTS(encoder, old_state)                                                   \
  asm volatile(                                                                              \
      "ldi  r31, 0                    \n\t"                                                  \
      "lds  r30, %[a]                 \n\t"                                                  \
      "ld   r24, Z                    \n\t"                                                  \
      "lds  r25, %[a]+1               \n\t"                                                  \
      "and  r24, r25                  \n\t"                                                  \
      "neg  r24                       \n\t"                                                  \
      "in   r25, %[state]             \n\t"                                                  \
      "rol  r25                       \n\t"                                                  \
      "lds  r30, %[b]                 \n\t"                                                  \
      "ld   r24, Z                    \n\t"                                                  \
      "lds  r30, %[b]+1               \n\t"                                                  \
      "and  r24, r30                  \n\t"                                                  \
      "neg  r24                       \n\t"                                                  \
      "rol  r25                       \n\t"                                                  \
      "mov  r30, r25                  \n\t" ::[a] "i"(&channels[encoder][0]),                \
      [b] "i"(&channels[encoder][1]), [state] "I"(_SFR_IO_ADDR(old_state)))

#define COUNT_EDGE(encoder, old_state)                                                       \
  asm volatile(                                                                              \
      "mov  r25, r30                  \n\t"                                                  \
      "andi r25, %[states]            \n\t"                                                  \
      "out  %[state], r25             \n\t"                                                  \
      "ori  r30, lo8(%[table])        \n\t"                                                  \
      "ldi  r31, hi8(%[table])        \n\t"                                                  \
      "ld   r25, Z                    \n\t"                                                  \
      "sbrs r25, 0                    \n\t"                                                  \
      "rjmp 2f                        \n\t"                                                  \
      "sts  %[stepped], r25           \n\t"                                                  \
      "mov  r31, r25                  \n\t"                                                  \
      "asr  r31                       \n\t"                                                  \
      "lds  r30, %[count]             \n\t"                                                  \
      "add  r30, r25                  \n\t"                                                  \
      "sts  %[count], r30             \n\t"                                                  \
      "lds  r30, %[count]+1           \n\t"                                                  \
      "adc  r30, r31                  \n\t"                                                  \
      "sts  %[count]+1, r30           \n\t"                                                  \
      "lds  r30, %[source]            \n\t"                                                  \
      "lds  r31, %[source]+1          \n\t"                                                  \
      "ld   r25, Z                    \n\t"                                                  \
      "sts  %[tick], r25              \n\t"                                                  \
      "rjmp 3f                        \n\t"                                                  \
      /* no step, or an impossible one */                                                    \
      "2: sbrs r25, 1                 \n\t"                                                  \
      "rjmp 3f                        \n\t"                                                  \
      "lds  r30, %[wrong]             \n\t"                                                  \
      "lds  r31, %[wrong]+1           \n\t"                                                  \
      "adiw r30, 1                    \n\t"                                                  \
      "breq 3f                        \n\t"                                                  \
      "sts  %[wrong]+1, r31           \n\t"                                                  \
      "sts  %[wrong], r30             \n\t"                                                  \
      "3:                             \n\t" ::[state] "I"(_SFR_IO_ADDR(old_state)),          \
      [states] "M"(quadrature::STATES), [table] "i"(&steps[encoder]),                        \
      [stepped] "i"(&stepped[encoder]), [count] "i"(&counts[encoder]),                       \
      [tick] "i"(&edge_ticks[encoder]), [source] "i"(&clock_low), [wrong] "i"(&impossible))

#define END_EDGE()                          \
  asm volatile(                             \
      "pop  r25                       \n\t" \
      "out  __SREG__, r25             \n\t" \
      "pop  r25                       \n\t" \
      "pop  r31                       \n\t" \
      "pop  r30                       \n\t" \
      "pop  r24                       \n\t" \
      "reti                           \n\t")

namespace {

#define LEFT_EDGE(read) read(0, GPIOR1); COUNT_EDGE(0, GPIOR1)
#define RIGHT_EDGE(read) read(1, GPIOR2); COUNT_EDGE(1, GPIOR2)
#define HANDLER(name, first, edges)      \
  void name() __attribute__((naked));    \
  void name() {                          \
    BEGIN_EDGE(first);                   \
    edges;                               \
    END_EDGE();                          \
  }

// Of ports with one encoder, and with both.
HANDLER(count_left, 0, LEFT_EDGE(READ_THIS_PORT))
HANDLER(count_right, 1, RIGHT_EDGE(READ_THIS_PORT))
HANDLER(count_both, 0, LEFT_EDGE(READ_THIS_PORT); RIGHT_EDGE(READ_THIS_PORT))
// Of encoders with their channels on two ports.
HANDLER(count_left_apart, 0, LEFT_EDGE(READ_ANY_PORTS))
HANDLER(count_right_apart, 1, RIGHT_EDGE(READ_ANY_PORTS))
HANDLER(count_both_apart, 0, LEFT_EDGE(READ_ANY_PORTS); RIGHT_EDGE(READ_ANY_PORTS))

}  // namespace

static_assert((quadrature::IMPOSSIBLE & 3) == 2, "bits 0 and 1 tell a step from an impossible one");
static_assert(MOTORS == 2, "one register of the chip for the state of each encoder");

ISR(PCINT0_vect, ISR_NAKED) { TO_HANDLER(0, PINB); }
ISR(PCINT1_vect, ISR_NAKED) { TO_HANDLER(1, PINC); }
ISR(PCINT2_vect, ISR_NAKED) { TO_HANDLER(2, PIND); }

static inline __attribute__((always_inline)) void sample_encoder(uint8_t encoder, uint16_t now) {
  newest.count[encoder] = counts[encoder];
  edges_left[encoder] = MOST_EDGES;
  if (!stepped[encoder]) return;
  stepped[encoder] = 0;
  newest.edge_tick[encoder] = static_cast<uint16_t>(now - static_cast<uint8_t>(now - edge_ticks[encoder]));
}

// The compare unit flags the end of its tick, so that at least one whole tick must lie ahead.  After a longer time without
// interrupts the next sample would come in the timer's next round: the cadence then starts again.  The clocks of 8 bits
// jump to this interrupt as well.
ISR(TIMER1_COMPB_vect) {
  const uint16_t now = clock_now();
  sample_encoder(0, now);
  sample_encoder(1, now);
  newest.tick = now;
  clock_took_sample(now);
  is_new = true;
  tell_loop();
}
ISR(TIMER2_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
ISR(TIMER0_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));

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
  for (uint8_t i = 0; i < MOTORS; i++) {
    sample.count[i] = counts[i];
    sample.edge_tick[i] = newest.edge_tick[i];
  }
  sample.tick = clock_now();
  sei();
}

uint16_t impossible_transitions() {
  cli();
  const uint16_t count = impossible;
  sei();
  return count;
}

bool encoder_masked(uint8_t encoder) { return (PCICR & changes[encoder]) != changes[encoder]; }

// ---- what follows runs when a wiring changes: small rather than fast
#pragma GCC optimize("Os")

namespace {

uint8_t level(const Channel& channel) { return *reinterpret_cast<volatile uint8_t*>(channel.inputs) & channel.mask; }

uint8_t state_of(uint8_t encoder) {
  return static_cast<uint8_t>((level(channels[encoder][0]) ? 2 : 0) | (level(channels[encoder][1]) ? 1 : 0));
}

uint8_t port_of(const Channel& channel) {
  return channel.inputs == _SFR_MEM_ADDR(PINB) ? 0 : channel.inputs == _SFR_MEM_ADDR(PINC) ? 1 : 2;
}

void take_channel(Channel& channel, int8_t pin) {
  const uint8_t port = is_connected(pin) ? port_of(pin) : 0;
  channel.inputs = static_cast<uint8_t>(_SFR_MEM_ADDR(PINB) + 3 * port);
  channel.mask = is_connected(pin) ? mask_of(pin) : 0;
}

// Pull-ups hold the lines of encoders with open collectors, and those of a broken wire.
void pull_up(const Channel& channel, bool on) {
  volatile uint8_t& port = registers_of(port_of(channel))[2];
  cli();
  const uint8_t rest = static_cast<uint8_t>(port & ~channel.mask);
  port = on ? rest | channel.mask : rest;
  sei();
}

#define SIXTEEN(of) of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7), of(8), of(9), of(10), of(11), of(12), of(13), of(14), of(15)
const int8_t STEPS[CHANNELS][quadrature::INDICES] PROGMEM = {{SIXTEEN(quadrature::single_step)},
                                                             {SIXTEEN(quadrature::step)}};

// Whose edges an interrupt may bring; interrupts of the encoders are off.
void watch(uint8_t encoder, bool single) {
  single = single || !channels[encoder][1].mask;
  const uint8_t* const row = reinterpret_cast<const uint8_t*>(STEPS[single ? 0 : 1]);
  for (uint8_t i = 0; i < quadrature::INDICES; i++) steps[encoder][i] = static_cast<int8_t>(flash_byte(row + i));
  changes[encoder] = 0;
  for (uint8_t i = 0; i < (single ? 1 : CHANNELS); i++) {
    const uint8_t port = port_of(channels[encoder][i]);
    volatile uint8_t& mask = (&PCMSK0)[port];
    mask = mask | channels[encoder][i].mask;
    changes[encoder] = static_cast<uint8_t>(changes[encoder] | 1 << port);
  }
  others[encoder] = static_cast<uint8_t>(~changes[encoder]);
}

bool is_apart(uint8_t encoder) {
  const Channel& b = channels[encoder][1];
  return b.mask && b.inputs != channels[encoder][0].inputs;
}

Handler* handler_of(uint8_t port) {
  const bool left = changes[0] >> port & 1, right = changes[1] >> port & 1;
  const bool apart = (left && is_apart(0)) || (right && is_apart(1));
  if (left && right) return apart ? count_both_apart : count_both;
  if (right) return apart ? count_right_apart : count_right;
  return apart ? count_left_apart : count_left;
}

void watch_none() {
  PCICR = 0;
  PCMSK0 = PCMSK1 = PCMSK2 = 0;
  changes[0] = changes[1] = 0;
}

}  // namespace

// Goes on from the present state.  An edge after the flag is cleared interrupts, even one before the state is read.  Where
// a port has lines of both encoders, both were masked.
void encoder_unmask(uint8_t encoder) {
  cli();
  PCIFR = changes[encoder];
  if (changes[encoder] & changes[0]) GPIOR1 = state_of(0);
  if (changes[encoder] & changes[1]) GPIOR2 = state_of(1);
  PCICR = PCICR | changes[encoder];
  sei();
}

void encoder_single_channel(bool on) {
  if (!changes[0]) return;
  watch_none();
  for (uint8_t i = 0; i < MOTORS; i++) watch(i, on);
  for (uint8_t port = 0; port < PORTS; port++) handlers[port] = handler_of(port);
  for (uint8_t i = 0; i < MOTORS; i++) encoder_unmask(i);
}

// ---- all pins

namespace {

// The timers of all outputs with PWM, a bit each.
uint8_t pwm_timers(const Wires& wires, uint8_t pwm) {
  uint8_t timers = 0;
  for (const auto& bridge : wires.bridge) {
    for (uint8_t i = 0; i < BRIDGE_PINS; i++) {
      if (!(pwm >> i & 1) || !is_connected(bridge[i])) continue;
      timers = static_cast<uint8_t>(timers | 1 << chip::functions(bridge[i]).timer);
    }
  }
  return timers;
}

// A timer that makes no PWM keeps still, or is the clock.
void start_timers(uint8_t timers, PwmRate rate) {
  const bool use_0 = timers & 1, use_1 = timers & 2, use_2 = timers & 4;
  fast_pwm = rate == PwmRate::medium;
  const uint8_t mode = static_cast<uint8_t>(_BV(WGM00) | (fast_pwm ? _BV(WGM01) : 0));
  const uint8_t divider = rate == PwmRate::fast ? _BV(CS00) : _BV(CS01);  // F_CPU or F_CPU / 8
  clock_use(!use_1   ? Clock::timer1
            : !use_2 ? Clock::timer2
            : !use_0 ? Clock::timer0
                     : Clock::pwm_timer2);
  if (use_0) {
    TCCR0A = mode;
    TCCR0B = divider;
  }
  if (use_2) {
    TCCR2A = mode;
    TCCR2B = divider;
  }
  if (!use_1) return;
  OCR1A = OCR1B = 0;
  TCCR1A = _BV(WGM10);
  TCCR1B = static_cast<uint8_t>(divider | (fast_pwm ? _BV(WGM12) : 0));
}

// The level goes first.
void begin_output(Output& output, int8_t pin, bool has_pwm) {
  volatile uint8_t* const registers = registers_of(port_of(pin));
  output.port = registers + 2;
  output.mask = mask_of(pin);
  const uint8_t rest = static_cast<uint8_t>(~output.mask);
  cli();
  port_rests[port_of(pin)] &= rest;
  registers[2] = registers[2] & rest;
  registers[1] = registers[1] | output.mask;
  sei();
  if (!has_pwm) return;
  const chip::Functions functions = chip::functions(pin);
  const Timer& timer = TIMER[functions.timer];
  output.control = timer.control;
  output.compare = timer.compare[functions.unit];
  output.control_bit = functions.unit ? OUTPUT_B : OUTPUT_A;
  timer_rests[functions.timer] &= static_cast<uint8_t>(~output.control_bit);
}

}  // namespace

void bridge_end() {
  bridge_off();
  watch_none();
  for (uint8_t port = 0; port < PORTS; port++) {
    registers_of(port)[1] &= port_rests[port];
    port_rests[port] = ALL;
  }
  for (uint8_t& rest : timer_rests) rest = ALL;
  for (uint8_t motor = 0; motor < MOTORS; motor++) {
    for (Output& output : outputs[motor]) output = Output();
    for (Channel& channel : channels[motor]) {
      pull_up(channel, false);
      channel.mask = 0;
    }
  }
}

void bridge_begin(const Wires& wires, PwmRate rate, uint8_t pwm) {
  bridge_end();
  start_timers(pwm_timers(wires, pwm), rate);
  for (uint8_t motor = 0; motor < MOTORS; motor++) {
    for (uint8_t i = 0; i < BRIDGE_PINS; i++) {
      const int8_t pin = wires.bridge[motor][i];
      if (is_connected(pin)) begin_output(outputs[motor][i], pin, pwm >> i & 1);
    }
    for (uint8_t i = 0; i < CHANNELS; i++) {
      take_channel(channels[motor][i], wires.encoder[motor][i]);
      pull_up(channels[motor][i], true);
    }
    changes[motor] = ALL;
  }
  encoder_single_channel(false);
}

void samples_begin() {
  edges_left[0] = edges_left[1] = MOST_EDGES;
  clock_plan_sample(static_cast<uint16_t>(ticks() + SAMPLE_TICKS));
  TIFR1 = _BV(OCF1B);
  TIMSK1 |= _BV(OCIE1B);
}

}  // namespace hal
#endif
