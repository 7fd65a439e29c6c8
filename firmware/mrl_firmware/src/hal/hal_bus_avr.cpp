// The chip's TWI as an I2C master that never waits.
#ifdef __AVR__
#include "fast.h"
#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/delay.h>

#include "hal.h"
#include "hal_avr.h"

namespace hal {
namespace {

volatile BusState bus;
volatile uint16_t latched;
uint8_t position;
bool reading;

}  // namespace

Transfer transfer;

#if MRL_MEGA
#define MRL_BUS(of) of##D
constexpr uint8_t SDA_LINE = _BV(PD1), SCL_LINE = _BV(PD0);
#else
#define MRL_BUS(of) of##C
constexpr uint8_t SDA_LINE = _BV(PC4), SCL_LINE = _BV(PC5);
#endif

constexpr uint8_t GO = _BV(TWINT) | _BV(TWEN) | _BV(TWIE);
constexpr uint8_t START = GO | _BV(TWSTA);
constexpr uint8_t STOP = _BV(TWINT) | _BV(TWEN) | _BV(TWSTO);

static inline void end_transfer(BusState state) {
  TWCR = STOP;
  bus = state;
  tell_loop();
}

// Acknowledges every byte except the last one.
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
  if (status == 0x50) {  // a byte was received, acknowledged
    transfer.in[position++] = TWDR;
    receive_next();
  } else if (status == 0x28 || status == 0x18) {  // byte or address sent, acknowledged
    send_next();
  } else if (status == 0x58) {  // the last byte was received
    transfer.in[position] = TWDR;
    end_transfer(BusState::idle);
  } else if (status == 0x08 || status == 0x10) {  // start, repeated start
    send_address();
  } else if (status == 0x40) {  // read address acknowledged
    latched = clock_now();
    receive_next();
  } else {
    end_transfer(status == 0x38 || status == 0x00 ? BusState::lost : BusState::nack);
  }
}

void bus_start() {
  // A pending stop takes one clock, at most 10 us; if the bus hangs, the caller's timeout handles it.
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
  return latched;  // the bus is not busy, so the interrupt does not write it
}

// Lines are open drain: low is an output of 0, high is an input with its pull-up.  Outputs of an H-bridge may be on the
// same port, and the watchdog's interrupt switches them off.
static void pull(uint8_t line, bool low) {
  if (MRL_BRIDGE) cli();
  if (low) {
    MRL_BUS(PORT) &= static_cast<uint8_t>(~line);
    MRL_BUS(DDR) |= line;
  } else {
    MRL_BUS(DDR) &= static_cast<uint8_t>(~line);
    MRL_BUS(PORT) |= line;
  }
  if (MRL_BRIDGE) sei();
  _delay_us(5);
}

void bus_recover() {
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

void bus_begin() {
  MRL_BUS(PORT) |= SDA_LINE | SCL_LINE;
  TWSR = 0;
  TWCR = _BV(TWEN);
}

#if MRL_BRIDGE
void bus_use(bool on) {
  cli();
  if (on) {
    bus_begin();
  } else {
    TWCR = 0;
    MRL_BUS(PORT) &= static_cast<uint8_t>(~(SDA_LINE | SCL_LINE));
    MRL_BUS(DDR) &= static_cast<uint8_t>(~(SDA_LINE | SCL_LINE));
    bus = BusState::idle;
  }
  sei();
}
#endif

}  // namespace hal
#endif
