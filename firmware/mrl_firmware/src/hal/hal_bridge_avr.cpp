// H-bridges on the outputs of the timers, and encoders: on pin-change interrupts of the Uno's ports, or on external and
// pin-change interrupts of the Mega.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_BRIDGE && !MRL_VIRTUAL
#include <avr/interrupt.h>
#include <avr/io.h>
#include <stddef.h>

#include "chip.h"
#include "flash.h"
#include "hal.h"
#include "hal_avr.h"
#include "../motors/quadrature.h"

namespace hal {
namespace {

using namespace mrl;

constexpr uint8_t ALL = 0xFF;

bool is_connected(int8_t pin) { return pin >= 0; }

uint8_t port_of(int8_t pin) { return static_cast<uint8_t>(chip::port(static_cast<uint8_t>(pin))); }

uint8_t mask_of(int8_t pin) { return chip::mask(static_cast<uint8_t>(pin)); }

volatile uint8_t* registers_of(uint8_t port) { return hal::registers_of(static_cast<chip::Port>(port)); }

// ---- outputs

// Of output A of all timers; those of B and C are two and four bits lower.
constexpr uint8_t OUTPUT_A = _BV(COM0A1);
static_assert(OUTPUT_A == _BV(COM2A1) && OUTPUT_A >> 2 == _BV(COM2B1) && OUTPUT_A >> 2 == _BV(COM0B1) &&
                  OUTPUT_A == _BV(COM1A1) && OUTPUT_A >> 2 == _BV(COM1B1) && _BV(WGM00) == _BV(WGM20) &&
                  _BV(WGM01) == _BV(WGM21) && _BV(WGM00) == _BV(WGM10) && _BV(CS00) == _BV(CS20) &&
                  _BV(CS01) == _BV(CS21) && _BV(CS00) == _BV(CS10) && _BV(CS01) == _BV(CS11),
              "the timers have the same bits");

#if MRL_MEGA
const uint16_t CONTROL[] PROGMEM = {_SFR_MEM_ADDR(TCCR0A), _SFR_MEM_ADDR(TCCR1A), _SFR_MEM_ADDR(TCCR2A),
                                    _SFR_MEM_ADDR(TCCR3A), _SFR_MEM_ADDR(TCCR4A), _SFR_MEM_ADDR(TCCR5A)};
#else
const uint16_t CONTROL[] PROGMEM = {_SFR_MEM_ADDR(TCCR0A), _SFR_MEM_ADDR(TCCR1A), _SFR_MEM_ADDR(TCCR2A)};
#endif

Output outputs[MOTORS][BRIDGE_PINS];

// What is left of the registers when all outputs are off.
uint8_t port_rests[chip::PORTS], timer_rests[chip::TIMERS];

bool fast_pwm;

}  // namespace

volatile uint8_t* control_of(uint8_t timer) {
  return reinterpret_cast<volatile uint8_t*>(static_cast<uintptr_t>(flash_uint16(&CONTROL[timer])));
}

// The ports go first: they take over when the timers let go.
void bridge_off() {
  const uint8_t status = SREG;
  cli();
  for (uint8_t port = 0; port < chip::PORTS; port++) registers_of(port)[2] &= port_rests[port];
  for (uint8_t timer = 0; timer < chip::TIMERS; timer++) *control_of(timer) &= timer_rests[timer];
  SREG = status;
}

#if MRL_MEGA
#define MRL_INLINE inline __attribute__((always_inline))
#else
#define MRL_INLINE
#endif

static MRL_INLINE void write(const Output& output, uint8_t duty) {
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

// Four motors must stop as quickly as two: on a Mega, the pins follow each other without a loop.
void bridge_write(uint8_t motor, const uint8_t (&duties)[BRIDGE_PINS]) {
#if MRL_MEGA
  const Output* const pins = outputs[motor];
  cli();
  if (!missed_kicks) {
    write(pins[3], duties[3]);
    write(pins[2], duties[2]);
    write(pins[1], duties[1]);
    write(pins[0], duties[0]);
  }
  sei();
#else
  const Output* output = outputs[motor] + BRIDGE_PINS;
  const uint8_t* duty = duties + BRIDGE_PINS;
  for (uint8_t left = BRIDGE_PINS; left; left--) {
    --output;
    --duty;
    cli();
    if (!missed_kicks) write(*output, *duty);
    sei();
  }
#endif
}
static_assert(BRIDGE_PINS == 4, "each pin is written");

// ---- encoders

namespace {

// A channel that is not connected reads as low: it has no mask.
struct Channel {
  volatile uint8_t* inputs;
  uint8_t mask;
#if MRL_MEGA
  int8_t pin;
#endif
};

// Interrupts that bring edges, as bits of registers that enable them.
#if MRL_MEGA
constexpr uint8_t EXTERNALS = 6, GROUPS = 3;  // INT0 to INT5 have pins on the board
struct Lines {
  uint8_t bits[1 + GROUPS];  // of EIMSK and of PCMSK0 to PCMSK2
};
constexpr uint8_t SOURCES = EXTERNALS + GROUPS;
#else
struct Lines {
  uint8_t bits[1];  // of PCICR
};
constexpr uint8_t SOURCES = chip::PORTS;
#endif
constexpr uint8_t ENABLES = sizeof(Lines);

struct Encoder {
  Channel channels[CHANNELS];
  uint8_t steps;  // low byte of the address of its row of STEPS
  Lines lines;    // its interrupts
  Lines others;   // those that are left when it is masked
#if MRL_MEGA
  uint8_t changes;  // its lines in any group
  volatile bool masked;
#endif
  uint8_t state;
  volatile uint8_t edges_left;  // until its interrupt is masked
  volatile uint16_t count;
  volatile uint8_t edge_tick;  // low byte
  volatile int8_t stepped;     // not 0: since the last sample
};
#if MRL_MEGA
#define MRL_ON_ONE_PAGE __attribute__((aligned(128)))
#else
#define MRL_ON_ONE_PAGE
#endif
Encoder encoders[MOTORS] MRL_ON_ONE_PAGE;

// The encoders of an interrupt: the first one, and how many more.
struct Source {
  Encoder* first;
  uint8_t more;
};
Source sources[SOURCES];
#if MRL_MEGA
struct Group {
  uint8_t lines;   // of all encoders
  uint8_t levels;  // at its last interrupt
};
Group groups[GROUPS];

// By the lines of a group that have changed: the low byte of the address of their encoder, if they are of one alone.
constexpr uint8_t NO_OWNER = 1;
uint8_t owners[GROUPS][256] __attribute__((aligned(256)));
static_assert(sizeof(encoders) <= 128 && sizeof(Encoder) > NO_OWNER, "addresses on one page, of which none is NO_OWNER");
#endif

volatile uint16_t impossible;

// Where only an echo is awaited.
Encoder nobody;

EncoderSample newest;
volatile bool is_new;

// As the interrupt takes them.  On a Mega, an encoder may count two for an edge: there it is twice the count and 1.
constexpr int8_t coded(int8_t step) {
  return static_cast<int8_t>(!MRL_MEGA || !step || step == quadrature::IMPOSSIBLE ? step : 2 * step + 1);
}
#define FOUR(of, i) coded(of(i)), coded(of(i + 1)), coded(of(i + 2)), coded(of(i + 3))
#define SIXTEEN(of) FOUR(of, 0), FOUR(of, 4), FOUR(of, 8), FOUR(of, 12)
const int8_t STEPS[][quadrature::INDICES] PROGMEM __attribute__((aligned((MRL_MEGA ? 4 : 2) * quadrature::INDICES))) = {
    {SIXTEEN(quadrature::single_step)},
    {SIXTEEN(quadrature::step)},
#if MRL_MEGA
    {SIXTEEN(quadrature::directed_step)},
#endif
};
enum class Edges : uint8_t { a, both, a_with_direction };  // rows of STEPS

#define MASK_LINES(enable, place)              \
      "lds  r30, " enable "           \n\t"    \
      "ldd  r31, Y+%[others]+" #place "\n\t"  \
      "and  r30, r31                  \n\t"    \
      "sts  " enable ", r30           \n\t"
#if MRL_MEGA
#define MASK_ENCODER                        \
      MASK_LINES("%[first]", 0)              \
      MASK_LINES("%[rest]", 1)               \
      MASK_LINES("%[rest]+1", 2)             \
      MASK_LINES("%[rest]+2", 3)             \
      "ldi  r25, 1                    \n\t" \
      "std  Y+%[masked], r25          \n\t"
#define ENABLES_OF_LINES                                                      \
  [first] "i"(_SFR_MEM_ADDR(EIMSK)), [rest] "i"(_SFR_MEM_ADDR(PCMSK0)),        \
      [masked] "I"(offsetof(Encoder, masked))
#define SIZE_OF_STEP                        \
      "asr  r25                       \n\t" \
      "mov  r31, r25                  \n\t" \
      "lsl  r31                       \n\t" \
      "sbc  r31, r31                  \n\t"
// In a group, the encoders with a line that has changed take an edge.
#define TAKE_ONE ".global hal_take_edge   \nhal_take_edge: \n"
#define TAKE_NEXT "rjmp 6f            \n"
#define LOOK_AT_CHANGES                     \
      ".global hal_look_at_changes    \n"   \
      "hal_look_at_changes:           \n"   \
      "6:  ldd  r30, Y+%[changes]     \n\t" \
      "in   r31, %[changed]           \n\t" \
      "and  r30, r31                  \n\t" \
      "breq 3b                        \n\t" \
      "rjmp 1b                        \n\t"
#define OPERANDS_OF_CHANGES [changes] "I"(offsetof(Encoder, changes)), [changed] "I"(_SFR_IO_ADDR(GPIOR2)),
#else
#define MASK_ENCODER MASK_LINES("%[first]", 0)
#define ENABLES_OF_LINES [first] "i"(_SFR_MEM_ADDR(PCICR))
#define SIZE_OF_STEP                        \
      "mov  r31, r25                  \n\t" \
      "asr  r31                       \n\t"
#define TAKE_NEXT "rjmp 1b            \n"
#define TAKE_ONE
#define LOOK_AT_CHANGES
#define OPERANDS_OF_CHANGES
#endif

// Counts the edges of a source: 115 cycles from its vector, and 55 for another encoder (Mega: in a group 126, and more if
// lines of several encoders have changed).  The compiler's code takes twice as long: the interrupts must let the USB port,
// the other encoder and the sample have their turn at 50 000 edges/s.  Y is saved and has the address of the first encoder,
// r25 is saved; a register of the chip that needs no LDS has the number of others.  NEG sets the carry if a channel is
// high.  Bit 0 of a step is set if it counts.
void count_edges() __attribute__((naked, used));
void count_edges() {
  asm volatile(
      "out  %[more], r25              \n\t"
      MRL_SAVE_STATUS_AND_Z
      TAKE_ONE
      "1:                             \n\t" ::[more] "I"(_SFR_IO_ADDR(GPIOR1)));
  asm volatile(
      "ldd  r25, Y+%[left]            \n\t"
      "dec  r25                       \n\t"
      "std  Y+%[left], r25            \n\t"
      "brne 2f                        \n\t"  // otherwise there are too many edges
      MASK_ENCODER
      "sbi  %[news], 0                \n"
      "2:                             \n\t" ::[left] "I"(offsetof(Encoder, edges_left)),
      [others] "I"(offsetof(Encoder, others)), ENABLES_OF_LINES, [news] "I"(_SFR_IO_ADDR(GPIOR0)));
  asm volatile(
      "ldd  r30, Y+%[a]               \n\t"
      "ldd  r31, Y+%[a]+1             \n\t"
      "ld   r25, Z                    \n\t"
      "ldd  r30, Y+%[a]+2             \n\t"
      "and  r30, r25                  \n\t"
      "neg  r30                       \n\t"
      "ldd  r25, Y+%[state]           \n\t"
      "rol  r25                       \n\t"
      "ldd  r30, Y+%[b]               \n\t"
      "ldd  r31, Y+%[b]+1             \n\t"
      "ld   r31, Z                    \n\t"
      "ldd  r30, Y+%[b]+2             \n\t"
      "and  r30, r31                  \n\t"
      "neg  r30                       \n\t"
      "rol  r25                       \n\t"  // the index of the step
      "ldd  r30, Y+%[steps]           \n\t"
      "or   r30, r25                  \n\t"
      "ldi  r31, hi8(%[table])        \n\t"
      "andi r25, %[states]            \n\t"
      "std  Y+%[state], r25           \n\t"
      "lpm  r25, Z                    \n\t" ::[a] "I"(offsetof(Encoder, channels)),
      [b] "I"(offsetof(Encoder, channels) + sizeof(Channel)), [state] "I"(offsetof(Encoder, state)),
      [states] "M"(quadrature::STATES), [steps] "I"(offsetof(Encoder, steps)), [table] "i"(STEPS));
  asm volatile(
      "sbrs r25, 0                    \n\t"
      "rjmp 5f                        \n\t"
      "std  Y+%[stepped], r25         \n\t"
      SIZE_OF_STEP
      "ldd  r30, Y+%[count]           \n\t"
      "add  r30, r25                  \n\t"
      "std  Y+%[count], r30           \n\t"
      "ldd  r30, Y+%[count]+1         \n\t"
      "adc  r30, r31                  \n\t"
      "std  Y+%[count]+1, r30         \n\t"
      "lds  r30, %[source]            \n\t"
      "lds  r31, %[source]+1          \n\t"
      "ld   r25, Z                    \n\t"
      "std  Y+%[tick], r25            \n"
      "3:  in   r25, %[more]          \n\t"
      "subi r25, 1                    \n\t"
      "brcs 4f                        \n\t"
      "out  %[more], r25              \n\t"
      "adiw r28, %[size]              \n\t"
      TAKE_NEXT
      "4:                             \n\t"
      MRL_RESTORE_STATUS_AND_Z
      "pop  r29                       \n\t"
      "pop  r28                       \n\t"
      "reti                           \n"
      "5:  sbrs r25, 1                \n\t"  // no step, or an impossible one
      "rjmp 3b                        \n\t"
      "lds  r30, %[wrong]             \n\t"
      "lds  r31, %[wrong]+1           \n\t"
      "adiw r30, 1                    \n\t"
      "breq 3b                        \n\t"
      "sts  %[wrong]+1, r31           \n\t"
      "sts  %[wrong], r30             \n\t"
      "rjmp 3b                        \n\t"
      LOOK_AT_CHANGES ::OPERANDS_OF_CHANGES [stepped] "I"(offsetof(Encoder, stepped)),
      [count] "I"(offsetof(Encoder, count)), [tick] "I"(offsetof(Encoder, edge_tick)), [source] "i"(&clock_low),
      [more] "I"(_SFR_IO_ADDR(GPIOR1)), [size] "I"(sizeof(Encoder)), [wrong] "i"(&impossible));
}

}  // namespace

static_assert((quadrature::IMPOSSIBLE & 3) == 2, "bits 0 and 1 tell a step from an impossible one");

// If an echo is awaited in a group of pins, or on an external interrupt.
#define TAKE_ECHO_OF(group)                  \
  asm volatile(                              \
      "sbic %[marks], %[mark]         \n\t" \
      "call %x[echo]                  \n\t" ::[marks] "I"(_SFR_IO_ADDR(GPIOR0)), \
      [mark] "I"(AWAITED_ECHO(group)), [echo] "i"(echo_edge))

#define COUNT_EDGES_OF(source)               \
  asm volatile(                              \
      "push r28                       \n\t" \
      "push r29                       \n\t" \
      "lds  r28, %[first]             \n\t" \
      "lds  r29, %[first]+1           \n\t" \
      "push r25                       \n\t" \
      "lds  r25, %[more]              \n\t" \
      "jmp  %x[count]                 \n\t" ::[first] "i"(&source.first), \
      [more] "i"(&source.more), [count] "i"(count_edges))

#if MRL_MEGA
// Without a change, as after a short pulse, all encoders of the group take an edge: a line that oscillates gets masked.
#define COUNT_EDGES_OF_GROUP(number, inputs_of_group, to_bits) \
  asm volatile(                              \
      "push r28                       \n\t" \
      "push r29                       \n\t" \
      "push r25                       \n\t" \
      MRL_SAVE_STATUS_AND_Z                  \
      "lds  r25, %[inputs]            \n\t" \
      to_bits                                \
      "lds  r30, %[levels]            \n\t" \
      "sts  %[levels], r25            \n\t" \
      "eor  r30, r25                  \n\t" \
      "ldi  r31, hi8(%[owners])       \n\t" \
      "ld   r28, Z                    \n\t" \
      "ldi  r29, hi8(%[encoders])     \n\t" \
      "ldi  r25, 0                    \n\t" \
      "out  %[left], r25              \n\t" \
      "cpi  r28, %[no_owner]          \n\t" \
      "breq 1f                        \n\t" \
      "jmp  hal_take_edge             \n"   \
      "1:  lds  r25, %[lines]         \n\t" \
      "and  r25, r30                  \n\t" \
      "brne 2f                        \n\t" \
      "ldi  r25, 0xFF                 \n"   \
      "2:  out  %[changed], r25       \n\t" \
      "lds  r28, %[first]             \n\t" \
      "lds  r29, %[first]+1           \n\t" \
      "lds  r25, %[more]              \n\t" \
      "out  %[left], r25              \n\t" \
      "jmp  hal_look_at_changes       \n\t" ::[inputs] "i"(_SFR_MEM_ADDR(inputs_of_group)), \
      [levels] "i"(&groups[number].levels), [lines] "i"(&groups[number].lines), \
      [owners] "i"(&owners[number]), [encoders] "i"(encoders), [no_owner] "M"(NO_OWNER), \
      [first] "i"(&sources[EXTERNALS + number].first), [more] "i"(&sources[EXTERNALS + number].more), \
      [changed] "I"(_SFR_IO_ADDR(GPIOR2)), [left] "I"(_SFR_IO_ADDR(GPIOR1)))

ISR(INT0_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[0]); }
ISR(INT1_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[1]); }
ISR(INT2_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[2]); }
ISR(INT3_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[3]); }
ISR(INT4_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[4]); }
ISR(INT5_vect, ISR_NAKED) { TAKE_ECHO_OF(EXTERNAL_INTERRUPTS); COUNT_EDGES_OF(sources[5]); }
ISR(PCINT0_vect, ISR_NAKED) { TAKE_ECHO_OF(0); COUNT_EDGES_OF_GROUP(0, PINB, ""); }
ISR(PCINT1_vect, ISR_NAKED) { TAKE_ECHO_OF(1); COUNT_EDGES_OF_GROUP(1, PINJ, "lsl r25 \n\t"); }  // bit 0 is that of D0
ISR(PCINT2_vect, ISR_NAKED) { TAKE_ECHO_OF(2); COUNT_EDGES_OF_GROUP(2, PINK, ""); }
#else
ISR(PCINT0_vect, ISR_NAKED) { TAKE_ECHO_OF(0); COUNT_EDGES_OF(sources[0]); }
ISR(PCINT1_vect, ISR_NAKED) { TAKE_ECHO_OF(1); COUNT_EDGES_OF(sources[1]); }
ISR(PCINT2_vect, ISR_NAKED) { TAKE_ECHO_OF(2); COUNT_EDGES_OF(sources[2]); }
#endif

static inline __attribute__((always_inline)) void sample_encoder(uint8_t which, uint16_t now) {
  Encoder& encoder = encoders[which];
  newest.count[which] = encoder.count;
  encoder.edges_left = MOST_EDGES;
  if (!encoder.stepped) return;
  encoder.stepped = 0;
  newest.edge_tick[which] = static_cast<uint16_t>(now - static_cast<uint8_t>(now - encoder.edge_tick));
}

// The compare unit flags the end of its tick, so that at least one whole tick must lie ahead.  After a longer time without
// interrupts the next sample would come in the timer's next round: the cadence then starts again.  The other clocks
// jump to this interrupt as well.
ISR(TIMER1_COMPB_vect) {
  const uint16_t now = clock_now();
  sample_encoder(0, now);
  sample_encoder(1, now);
#if MRL_MEGA
  sample_encoder(2, now);
  sample_encoder(3, now);
#endif
  newest.tick = now;
  clock_took_sample(now);
  is_new = true;
  tell_loop();
}
ISR(TIMER2_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
ISR(TIMER0_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
#if MRL_MEGA
ISR(TIMER3_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
ISR(TIMER4_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
ISR(TIMER5_COMPB_vect, ISR_ALIASOF(TIMER1_COMPB_vect));
#endif
static_assert(MOTORS == (MRL_MEGA ? 4 : 2), "each encoder is sampled");

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

uint16_t encoder_read(uint16_t (&counts)[MOTORS]) {
  cli();
  for (uint8_t i = 0; i < MOTORS; i++) counts[i] = encoders[i].count;
  const uint16_t tick = clock_now();
  sei();
  return tick;
}

uint16_t impossible_transitions() {
  cli();
  const uint16_t count = impossible;
  sei();
  return count;
}

// The register that enables interrupts, by the place of its bits in Lines.
static inline volatile uint8_t& enables(uint8_t place) {
#if MRL_MEGA
  return place ? (&PCMSK0)[place - 1] : EIMSK;
#else
  return (&PCICR)[place];
#endif
}

bool encoder_masked(uint8_t encoder) {
#if MRL_MEGA
  return encoders[encoder].masked;
#else
  const uint8_t ports = encoders[encoder].lines.bits[0];
  return (PCICR & ports) != ports;
#endif
}

// ---- what follows runs when a wiring changes: small rather than fast
#pragma GCC optimize("Os")

namespace {

bool level(const Channel& channel) { return *channel.inputs & channel.mask; }

void take_state(Encoder& encoder) {
  encoder.state = static_cast<uint8_t>((level(encoder.channels[0]) ? 2 : 0) | (level(encoder.channels[1]) ? 1 : 0));
}

void take_channel(Channel& channel, int8_t pin) {
  channel.inputs = registers_of(is_connected(pin) ? port_of(pin) : 0);
  channel.mask = is_connected(pin) ? mask_of(pin) : 0;
#if MRL_MEGA
  channel.pin = pin;
#endif
}

// Pull-ups hold the lines of encoders with open collectors, and those of a broken wire.
void pull_up(const Channel& channel, bool on) {
  if (!channel.mask) return;
  volatile uint8_t& port = channel.inputs[2];
  cli();
  const uint8_t rest = static_cast<uint8_t>(port & ~channel.mask);
  port = on ? rest | channel.mask : rest;
  sei();
}

// Whose edges count, and which interrupts bring them; those are off.
#if MRL_MEGA
bool can_interrupt(const Channel& channel) {
  const chip::Functions functions = chip::functions(channel.pin);
  return functions.external >= 0 || functions.change >= 0;
}

// A pin has one of the two interrupts; returns its source, and sets its bit.
uint8_t take_line(Lines& lines, const Channel& channel) {
  const chip::Functions functions = chip::functions(channel.pin);
  const bool is_external = functions.external >= 0;
  const uint8_t number = static_cast<uint8_t>(is_external ? functions.external : functions.change);
  uint8_t& bits = lines.bits[is_external ? 0 : 1 + number / 8];
  bits = static_cast<uint8_t>(bits | 1 << (number & 7));
  if (!is_external) return static_cast<uint8_t>(EXTERNALS + number / 8);
  sense_edges(number);
  return number;
}

uint8_t owner_of(uint8_t group, uint8_t changed) {
  uint8_t owner = NO_OWNER;
  for (const Encoder& encoder : encoders) {
    if (!(encoder.lines.bits[1 + group] & changed)) continue;
    if (owner != NO_OWNER) return NO_OWNER;
    owner = static_cast<uint8_t>(reinterpret_cast<uintptr_t>(&encoder));
  }
  return owner;
}
#else
constexpr bool can_interrupt(const Channel&) { return true; }

uint8_t take_line(Lines& lines, const Channel& channel) {
  const uint8_t port = static_cast<uint8_t>((channel.inputs - &PINB) / 3);
  volatile uint8_t& mask = (&PCMSK0)[port];
  mask = mask | channel.mask;
  lines.bits[0] = static_cast<uint8_t>(lines.bits[0] | 1 << port);
  return port;
}
#endif

void watch(Encoder& encoder, bool single) {
  single = single || !encoder.channels[1].mask;
  const bool both = !single && can_interrupt(encoder.channels[1]);
  const Edges edges = single ? Edges::a : both ? Edges::both : Edges::a_with_direction;
  encoder.steps = static_cast<uint8_t>(reinterpret_cast<uintptr_t>(STEPS[static_cast<uint8_t>(edges)]));
  for (uint8_t i = 0; i < (both ? CHANNELS : 1); i++) {
    Source& source = sources[take_line(encoder.lines, encoder.channels[i])];
    if (!source.first) source.first = &encoder;
    source.more = static_cast<uint8_t>(&encoder - source.first);
  }
  for (uint8_t i = 0; i < ENABLES; i++) encoder.others.bits[i] = static_cast<uint8_t>(~encoder.lines.bits[i]);
#if MRL_MEGA
  encoder.changes = 0;
  for (uint8_t group = 0; group < GROUPS; group++) {
    const uint8_t bits = encoder.lines.bits[1 + group];
    encoder.changes = static_cast<uint8_t>(encoder.changes | bits);
    groups[group].lines = static_cast<uint8_t>(groups[group].lines | bits);
  }
#endif
}

void watch_none() {
  for (uint8_t i = 0; i < ENABLES; i++) enables(i) = 0;
  for (uint8_t group = 0; group < 3; group++) (&PCMSK0)[group] = 0;
  for (Source& source : sources) source.first = nullptr;
  for (Encoder& encoder : encoders) encoder.lines = Lines();
#if MRL_MEGA
  for (Group& group : groups) group.lines = 0;
#endif
}

}  // namespace

// Goes on from the present state.  An old flag brings an interrupt that finds no step.  Where a port of the Uno has lines of
// both encoders, both were masked.
void encoder_unmask(uint8_t which) {
  const Encoder& own = encoders[which];
  const Lines lines = own.lines;
  cli();
  for (Encoder& encoder : encoders) {
    if (MRL_MEGA ? &own == &encoder : lines.bits[0] & encoder.lines.bits[0]) take_state(encoder);
  }
  for (uint8_t i = 0; i < ENABLES; i++) enables(i) = enables(i) | lines.bits[i];
#if MRL_MEGA
  encoders[which].masked = false;
#endif
  sei();
}

void encoder_single_channel(bool on) {
  watch_none();
  for (Encoder& encoder : encoders) {
    if (encoder.channels[0].mask) watch(encoder, on);
  }
  nobody.steps = static_cast<uint8_t>(reinterpret_cast<uintptr_t>(STEPS[0]));
  for (uint8_t& bits : nobody.others.bits) bits = ALL;
  for (Source& source : sources) {
    if (!source.first) source = {&nobody, 0};
  }
#if MRL_MEGA
  for (uint8_t group = 0; group < GROUPS; group++) {
    for (uint16_t changed = 0; changed < 256; changed++) {
      owners[group][changed] = owner_of(group, static_cast<uint8_t>(changed));
    }
  }
  PCICR = 7;
#endif
  for (uint8_t i = 0; i < MOTORS; i++) encoder_unmask(i);
}

uint8_t encoder_groups() {
#if MRL_MEGA
  return 7;
#else
  return encoders[0].lines.bits[0] | encoders[1].lines.bits[0];
#endif
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

// Those of the servos.
uint8_t pulse_timers(const Wires& wires) {
  uint8_t timers = 0;
  for (const int8_t pin : wires.servo) {
    if (is_connected(pin)) timers = static_cast<uint8_t>(timers | 1 << chip::functions(pin).timer);
  }
  return timers;
}

// The first one that is left: with 16 bits if it can be.
Clock clock_next_to(uint8_t timers) {
#define MRL_IF_FREE(n) if (!(timers >> n & 1)) return Clock::timer##n;
  MRL_WIDE_TIMERS(MRL_IF_FREE)
  MRL_IF_FREE(2)
  MRL_IF_FREE(0)
  return Clock::pwm_timer2;
}

void start_pwm(uint8_t timer, uint8_t divider) {
  volatile uint8_t* const control = control_of(timer);
  const bool wide = chip::is_wide(static_cast<int8_t>(timer));
  if (wide) {
    for (uint8_t place = 14; place > 8; place--) control[place - 1] = 0;  // the high bytes come first
  }
  control[0] = static_cast<uint8_t>(_BV(WGM00) | (fast_pwm && !wide ? _BV(WGM01) : 0));
  control[1] = static_cast<uint8_t>(divider | (fast_pwm && wide ? _BV(WGM12) : 0));
}

// A timer that makes no PWM keeps still, or is the clock.
void start_timers(uint8_t timers, PwmRate rate) {
  fast_pwm = rate == PwmRate::medium;
  for (uint8_t timer = 0; timer < chip::TIMERS; timer++) {
    if (timers >> timer & 1) start_pwm(timer, rate == PwmRate::fast ? _BV(CS00) : _BV(CS01));  // F_CPU or F_CPU / 8
  }
}

}  // namespace

// The level goes first.
void begin_output(Output& output, int8_t pin, bool has_pwm) {
  const uint8_t number = static_cast<uint8_t>(pin);
  output.port = registers_of(port_of(pin)) + 2;
  output.mask = mask_of(pin);
  pin_output(number, false);
  port_rests[port_of(pin)] &= static_cast<uint8_t>(~output.mask);
  if (!has_pwm) return;
  const chip::Functions functions = chip::functions(pin);
  const uint8_t unit = static_cast<uint8_t>(functions.unit), timer = static_cast<uint8_t>(functions.timer);
  output.control = control_of(timer);
  output.compare = output.control + (chip::is_wide(functions.timer) ? 8 + 2 * unit : 3 + unit);
  output.control_bit = static_cast<uint8_t>(OUTPUT_A >> 2 * unit);
  timer_rests[timer] &= static_cast<uint8_t>(~output.control_bit);
}

void bridge_end() {
  bridge_off();
  servos_end();
  ranges_end();
  watch_none();
  for (uint8_t port = 0; port < chip::PORTS; port++) {
    registers_of(port)[1] &= port_rests[port];
    port_rests[port] = ALL;
  }
  for (uint8_t& rest : timer_rests) rest = ALL;
  for (uint8_t motor = 0; motor < MOTORS; motor++) {
    for (Output& output : outputs[motor]) output = Output();
    for (Channel& channel : encoders[motor].channels) {
      pull_up(channel, false);
      channel.mask = 0;
    }
  }
}

void bridge_begin(const Wires& wires, PwmRate rate, uint8_t pwm) {
  bridge_end();
  const uint8_t timers = pwm_timers(wires, pwm);
  clock_use(clock_next_to(timers | pulse_timers(wires)));
  if (wires.ranges && ranges_need_pwm(timers)) rate = PwmRate::medium;
  start_timers(timers, rate);
  if (wires.ranges) ranges_begin(timers);
  servos_begin(wires);
  for (uint8_t motor = 0; motor < MOTORS; motor++) {
    for (uint8_t i = 0; i < BRIDGE_PINS; i++) {
      const int8_t pin = wires.bridge[motor][i];
      if (is_connected(pin)) begin_output(outputs[motor][i], pin, pwm >> i & 1);
    }
    for (uint8_t i = 0; i < CHANNELS; i++) {
      Channel& channel = encoders[motor].channels[i];
      take_channel(channel, wires.encoder[motor][i]);
      pull_up(channel, true);
    }
  }
  encoder_single_channel(false);
}

void samples_begin() {
  bridge_end();
  for (Encoder& encoder : encoders) encoder.edges_left = MOST_EDGES;
  clock_plan_sample(static_cast<uint16_t>(ticks() + SAMPLE_TICKS));
  TIFR1 = _BV(OCF1B);
  TIMSK1 |= _BV(OCIE1B);
}

}  // namespace hal
#endif
