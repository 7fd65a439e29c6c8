// The ATmega328P of the Uno, or the ATmega2560 of the Mega, at 16 MHz: resets, time, USB port, analog inputs, pins, EEPROM.  I2C, the dust sensor's input,
// the radio's port and the H-bridge have their own files.
#ifdef __AVR__
#include "fast.h"
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

#include "chip.h"
#include "hal.h"
#include "hal_avr.h"
#include "../../pins.h"
#include "ring.h"

static_assert(F_CPU == 16000000UL, "baud rate, ticks and I2C clock are computed for 16 MHz");

namespace hal {
namespace {

constexpr uint8_t RUNNING_MARK = 0xA5, WATCHDOG_MARK = 0x5A;

mrl::Ring<64> received;
mrl::Ring<SERIAL_OUT_SIZE> sending;
volatile uint8_t overruns;

// Each mark has two bytes, the second one inverted, so that random RAM does not look like a mark.
struct Mark {
  uint8_t value, inverse;
  bool is(uint8_t mark) const { return value == mark && inverse == static_cast<uint8_t>(~mark); }
  void set(uint8_t mark) {
    value = mark;
    inverse = static_cast<uint8_t>(~mark);
  }
};
Mark running_mark __attribute__((section(".noinit")));
Mark watchdog_mark __attribute__((section(".noinit")));
uint8_t reset_flags __attribute__((section(".noinit")));
ResetTrace trace;

}  // namespace

volatile uint8_t missed_kicks;

// ---- resets

// After a watchdog reset the watchdog keeps running at its shortest period: it must be off before main() starts.
void save_reset_flags() __attribute__((naked, used, section(".init3")));
void save_reset_flags() {
  reset_flags = MCUSR;
  MCUSR = 0;
  wdt_disable();
}

static void take_trace() {
  const uint8_t flags = reset_flags;
  trace.power_on = flags & _BV(PORF);
  trace.external = flags & _BV(EXTRF);
  trace.brown_out = flags & _BV(BORF);
  trace.watchdog = flags & _BV(WDRF);
  trace.watchdog_marked = watchdog_mark.is(WATCHDOG_MARK);
  trace.memory_kept = running_mark.is(RUNNING_MARK);
  watchdog_mark.set(0);
  running_mark.set(RUNNING_MARK);
}

ResetTrace reset_trace() { return trace; }

// The period is 128 ms: the interrupt counts the first miss and switches an H-bridge off, leaves the mark at the second;
// the third resets the chip.
static void start_watchdog() {
  cli();
  wdt_reset();
  WDTCSR = _BV(WDCE) | _BV(WDE);
  WDTCSR = _BV(WDIE) | _BV(WDE) | _BV(WDP1) | _BV(WDP0);
}

ISR(WDT_vect) {
  if (++missed_kicks < 2) {
    if (MRL_BRIDGE) bridge_off();
    WDTCSR |= _BV(WDIE);
  } else {
    watchdog_mark.set(WATCHDOG_MARK);
  }
}

void watchdog_kick() {
  wdt_reset();
  if (!missed_kicks) return;
  missed_kicks = 0;
  watchdog_mark.set(0);
  WDTCSR |= _BV(WDIE);
}

// ---- time

uint16_t ticks() {
  const uint8_t status = SREG;
  cli();
  const uint16_t now = clock_now();
  SREG = status;
  return now;
}

// ---- sleep

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
  tell_loop();
  reti();
}
#if MRL_MEGA
ISR(TIMER3_COMPA_vect, ISR_ALIASOF(TIMER1_COMPA_vect));
ISR(TIMER4_COMPA_vect, ISR_ALIASOF(TIMER1_COMPA_vect));
ISR(TIMER5_COMPA_vect, ISR_ALIASOF(TIMER1_COMPA_vect));
#endif

// The caller looks for the news after this, so that an interrupt between reading and clearing the flag loses nothing.
bool take_news() {
  if (!has_news()) return false;
  GPIOR0 &= static_cast<uint8_t>(~_BV(0));
  return true;
}

// The compare unit flags the end of the tick in its register, so that at least one whole tick must lie ahead.  SEI lets
// one more instruction pass before any interrupt: what has come since the last look wakes the chip at once.  Each
// NOP lets another interrupt run behind the one that has woken the chip, before they are held off again.
void sleep_until(uint16_t tick) {
  cli();
  clock_set_alarm(static_cast<uint16_t>(tick - 1));
  while (!has_news() && !received.used() && static_cast<int16_t>(tick - clock_now()) > 1) {
    asm volatile("sei\n\tsleep\n\tnop\n\tnop\n\tcli" ::: "memory");
  }
  sei();
}

// A bootloader may have left timers running.
static void start_clock() {
  TIMSK0 = 0;
  TCCR0B = 0;
  TCCR2B = 0;
  TCCR1A = 0;
  TCCR1B = _BV(CS12) | _BV(CS10);  // F_CPU / 1024
  TIMSK1 = _BV(OCIE1A);
  SMCR = _BV(SE);  // idle mode: all but the CPU goes on
}

// ---- serial port

#if MRL_MEGA
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

ISR(USART_RX_vect) {
  const uint8_t overrun = UCSR0A & _BV(DOR0);
  const uint8_t byte = UDR0;
  const bool full = !received.room();
  if (!full) received.put(byte);
  if ((overrun || full) && overruns != 255) overruns++;
}

ISR(USART_UDRE_vect) {
  UDR0 = sending.take();
  const uint8_t left = sending.used();
  if (!left) UCSR0B &= static_cast<uint8_t>(~_BV(UDRIE0));
  if (!left || left % 8 == SERIAL_OUT_NEWS) tell_loop();
}

int16_t serial_read() { return received.used() ? received.take() : -1; }

bool serial_received() { return received.used(); }

void serial_discard() { received.clear(); }

uint8_t serial_overruns() {
  if (!overruns) return 0;
  cli();
  const uint8_t count = overruns;
  overruns = 0;
  sei();
  return count;
}

uint8_t serial_room() { return sending.room(); }

uint8_t serial_waiting() { return sending.used(); }

void serial_write(uint8_t byte) {
  sending.put(byte);
  cli();
  UCSR0B |= _BV(UDRIE0);
  sei();
}

void serial_speed(uint8_t divider) { UBRR0 = divider; }

static void start_serial() {
  UCSR0A = _BV(U2X0);
  UBRR0 = SERIAL_DIVIDER;
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

// ---- analog inputs

ISR(ADC_vect, ISR_NAKED) {
  tell_loop();
  reti();
}

void adc_start(uint8_t channel) {
#if MRL_MEGA
  ADCSRB = channel & 8 ? _BV(MUX5) : 0;  // of channels 8 to 15
  channel &= 7;
#endif
  ADMUX = static_cast<uint8_t>(_BV(REFS0) | channel);
  ADCSRA |= _BV(ADSC);
}

int16_t adc_result() { return ADCSRA & _BV(ADSC) ? static_cast<int16_t>(-1) : static_cast<int16_t>(ADC); }

static void start_adc() { ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0); }

// ---- pins

// The level goes first, so that the pin never shows the other one; that of an input is its pull-up.  Not merged into its callers, to save flash.
__attribute__((noinline)) static void set_pin(uint8_t pin, bool output, bool level) {
  volatile uint8_t* const registers = registers_of(mrl::chip::port(pin));
  const uint8_t mask = mrl::chip::mask(pin), others = static_cast<uint8_t>(~mask), status = SREG;
  cli();
  registers[2] = static_cast<uint8_t>((registers[2] & others) | (level ? mask : 0));
  registers[1] = static_cast<uint8_t>((registers[1] & others) | (output ? mask : 0));
  SREG = status;
}

void pin_output(uint8_t pin, bool level) { set_pin(pin, true, level); }

#if MRL_BRIDGE
void pin_release(uint8_t pin) { set_pin(pin, false, false); }

void pin_pull_up(uint8_t pin) { set_pin(pin, false, true); }

bool pin_level(uint8_t pin) { return *registers_of(mrl::chip::port(pin)) & mrl::chip::mask(pin); }
#endif

// ---- EEPROM

ISR(EE_READY_vect, ISR_NAKED) {
  EECR &= static_cast<uint8_t>(~_BV(EERIE));
  tell_loop();
  reti();
}

bool eeprom_ready() { return !(EECR & _BV(EEPE)); }

uint8_t eeprom_read(uint16_t address) {
  EEAR = address;
  EECR |= _BV(EERE);
  return EEDR;
}

void eeprom_write(uint16_t address, uint8_t value) {
  EEAR = address;
  EEDR = value;
  cli();
  EECR |= _BV(EEMPE);
  EECR |= _BV(EEPE);
  EECR |= _BV(EERIE);
  sei();
}

void begin() {
  take_trace();
  start_clock();
  start_serial();
  if (!MRL_BRIDGE) bus_begin();
  start_adc();
  if (MRL_ENVIRONMENT) dust_begin();
  if (MRL_BRIDGE) samples_begin();
  start_watchdog();
  sei();
}

}  // namespace hal
#endif
