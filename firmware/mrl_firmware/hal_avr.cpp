// The ATmega328P of the Uno at 16 MHz.  The only file that knows Arduino.h and the registers.
#ifdef __AVR__
#include <Arduino.h>
#include <avr/wdt.h>

#include "hal.h"
#include "pins.h"
#include "ring.h"

static_assert(F_CPU == 16000000UL, "baud rate, ticks and I2C clock are computed for 16 MHz");

namespace hal {
namespace {

constexpr uint16_t BAUD_DIVIDER = 16;  // 117647 baud with U2X, 2.1 % above 115200
constexpr uint8_t RUNNING_MARK = 0xA5, WATCHDOG_MARK = 0x5A;

mrl::Ring<64> received;
mrl::Ring<SERIAL_OUT_SIZE> sending;
volatile uint8_t overruns;

volatile BusState bus;
volatile uint16_t latched;
uint8_t position;
bool reading;

// Two bytes each, the second inverted, so that random RAM does not pass for a mark.
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
volatile uint8_t missed_kicks;

}  // namespace

Transfer transfer;

// ---- resets

// After a watchdog reset the watchdog runs on at its shortest period: it must be off before main() is reached.
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

// 128 ms a period: the interrupt counts one miss, leaves the mark at the second, and the third resets.
static void start_watchdog() {
  cli();
  wdt_reset();
  WDTCSR = _BV(WDCE) | _BV(WDE);
  WDTCSR = _BV(WDIE) | _BV(WDE) | _BV(WDP1) | _BV(WDP0);
}

ISR(WDT_vect) {
  if (++missed_kicks < 2) {
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
  const uint16_t now = TCNT1;
  SREG = status;
  return now;
}

// ---- serial line

ISR(USART_RX_vect) {
  const uint8_t overrun = UCSR0A & _BV(DOR0);
  const uint8_t byte = UDR0;
  const bool full = !received.room();
  if (!full) received.put(byte);
  if ((overrun || full) && overruns != 255) overruns++;
}

ISR(USART_UDRE_vect) {
  UDR0 = sending.take();
  if (!sending.used()) UCSR0B &= static_cast<uint8_t>(~_BV(UDRIE0));
}

int16_t serial_read() { return received.used() ? received.take() : -1; }

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

static void start_serial() {
  UCSR0A = _BV(U2X0);
  UBRR0 = BAUD_DIVIDER;
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

// ---- I2C

constexpr uint8_t GO = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);
constexpr uint8_t START = GO | _BV(TWSTA);
constexpr uint8_t STOP = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);

static inline void end_transfer(BusState state) {
  TWCR = STOP;
  bus = state;
}

// Acknowledges every byte but the last one.
static inline void receive_next() {
  TWCR = static_cast<uint8_t>(position + 1) < transfer.in_count ? GO | _BV(TWEA) : GO;
}

static inline void send_next() {
  if (position < transfer.out_count) {
    TWDR = transfer.out[position++];
    TWCR = GO;
  } else if (transfer.in_count) {
    reading = true;
    position = 0;
    TWCR = transfer.stop_between ? START | _BV(TWSTO) : START;
  } else {
    end_transfer(BusState::idle);
  }
}

static inline void send_address() {
  TWDR = static_cast<uint8_t>(transfer.address << 1 | reading);
  TWCR = GO;
}

ISR(TWI_vect) {
  const uint8_t status = TWSR;
  if (status == 0x50) {  // a byte came, acknowledged
    transfer.in[position++] = TWDR;
    receive_next();
  } else if (status == 0x28 || status == 0x18) {  // byte or address sent, acknowledged
    send_next();
  } else if (status == 0x58) {  // the last byte came
    transfer.in[position] = TWDR;
    end_transfer(BusState::idle);
  } else if (status == 0x08 || status == 0x10) {  // start, repeated start
    send_address();
  } else if (status == 0x40) {  // read address acknowledged
    latched = TCNT1;
    receive_next();
  } else {
    end_transfer(status == 0x38 || status == 0x00 ? BusState::lost : BusState::nack);
  }
}

void bus_start() {
  // A stop that is still on its way takes one clock, 10 us at most; a bus that hangs is the caller's timeout.
  for (uint8_t patience = 100; patience && (TWCR & _BV(TWSTO)); patience--) {
  }
  position = 0;
  reading = !transfer.out_count;
  TWBR = transfer.divider;
  bus = BusState::busy;
  TWCR = START;
}

BusState bus_state() { return bus; }

uint16_t bus_latched() {
  return latched;  // not busy: the interrupt is quiet
}

// Lines are open drain: low is an output of 0, high is an input with its pull-up.
static void pull(uint8_t line, bool low) {
  if (low) {
    PORTC &= static_cast<uint8_t>(~line);
    DDRC |= line;
  } else {
    DDRC &= static_cast<uint8_t>(~line);
    PORTC |= line;
  }
  delayMicroseconds(5);
}

void bus_recover() {
  constexpr uint8_t SDA_LINE = _BV(PC4), SCL_LINE = _BV(PC5);
  TWCR = 0;
  for (uint8_t clock = 0; clock < 9; clock++) {
    pull(SCL_LINE, true);
    pull(SCL_LINE, false);
  }
  pull(SCL_LINE, true);
  pull(SDA_LINE, true);
  pull(SCL_LINE, false);
  pull(SDA_LINE, false);
  bus = BusState::idle;
  TWCR = _BV(TWEN);
}

static void start_bus() {
  PORTC |= _BV(PC4) | _BV(PC5);
  TWSR = 0;
  TWCR = _BV(TWEN);
}

// ---- analog inputs

void adc_start(uint8_t channel) {
  ADMUX = static_cast<uint8_t>(_BV(REFS0) | channel);
  ADCSRA |= _BV(ADSC);
}

int16_t adc_result() { return ADCSRA & _BV(ADSC) ? static_cast<int16_t>(-1) : static_cast<int16_t>(ADC); }

static void start_adc() { ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0); }

// ---- pins

void pin_output(uint8_t pin, bool level) {
  digitalWrite(pin, level ? HIGH : LOW);
  pinMode(pin, OUTPUT);
}

// ---- EEPROM

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
  sei();
}

// ---- dust sensor

#if MRL_ENVIRONMENT
namespace {
volatile uint32_t low_ticks;
volatile uint16_t fell_at;
volatile bool dust_low;
volatile bool dust_edge;
}  // namespace

// Timer1 latches the tick of each edge, so that the pulse is exact however late the interrupt comes.
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

bool dust_changed() {
  const bool changed = dust_edge;
  dust_edge = false;
  return changed;
}

static void start_dust() {
  TCCR1B = static_cast<uint8_t>((TCCR1B | _BV(ICNC1)) & ~_BV(ICES1));
  TIFR1 = _BV(ICF1);
  TIMSK1 = _BV(ICIE1);
}
#else
static void start_dust() {}
#endif

void begin() {
  take_trace();
  TCCR1A = 0;
  TCCR1B = _BV(CS12) | _BV(CS10);  // F_CPU / 1024
  start_serial();
  start_bus();
  start_adc();
  start_dust();
  start_watchdog();
  sei();
}

}  // namespace hal
#endif
