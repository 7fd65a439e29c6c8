// A serial line at 9600 baud made of two pins, INT0 and timer 2.  No interrupt lasts longer than a few microseconds,
// so that the USB line at 115200 baud, whose receiver bridges 170 us, never loses a byte to it.
#include "build.h"
#if defined(__AVR__) && MRL_XBEE
#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal.h"
#include "pins.h"
#include "ring.h"

namespace hal {
namespace {

static_assert(mrl::pins::XBEE_IN == 2 && mrl::pins::XBEE_OUT == 3, "D2 is INT0; both are on port D here");
constexpr uint8_t IN = _BV(PD2), OUT = _BV(PD3);

constexpr uint8_t BIT = 52;        // timer ticks of 2 us: 9615 baud
constexpr uint8_t HALF_BIT = 24;   // a little early: the interrupt comes late
constexpr uint8_t FRAME_BITS = 10;

mrl::Ring<64> heard;
mrl::Ring<RADIO_OUT_SIZE> speaking;

uint8_t in_bits, in_byte;    // bits seen of the byte that comes in, its start bit included
uint8_t out_bits;            // bits left of the byte that goes out
uint16_t out_frame;          // they themselves, the next one lowest

void listen() {
  EIFR = _BV(INTF0);
  EIMSK |= _BV(INT0);
}

void stop_sampling() {
  TIMSK2 &= static_cast<uint8_t>(~_BV(OCIE2A));
  listen();
}

}  // namespace

// The falling edge of a start bit: from its middle on the timer looks once a bit.
ISR(INT0_vect) {
  OCR2A = static_cast<uint8_t>(TCNT2 + HALF_BIT);
  EIMSK &= static_cast<uint8_t>(~_BV(INT0));
  in_bits = 0;
  TIFR2 = _BV(OCF2A);
  TIMSK2 |= _BV(OCIE2A);
}

ISR(TIMER2_COMPA_vect) {
  const bool high = PIND & IN;
  OCR2A = static_cast<uint8_t>(OCR2A + BIT);
  const uint8_t bit = in_bits++;
  if (bit == 0) {
    if (high) stop_sampling();  // a spike
  } else if (bit < FRAME_BITS - 1) {
    in_byte = static_cast<uint8_t>(in_byte >> 1 | (high ? 0x80 : 0));
  } else {
    if (high && heard.room()) heard.put(in_byte);
    stop_sampling();
  }
}

ISR(TIMER2_COMPB_vect) {
  if (out_frame & 1) {
    PORTD |= OUT;
  } else {
    PORTD &= static_cast<uint8_t>(~OUT);
  }
  OCR2B = static_cast<uint8_t>(OCR2B + BIT);
  out_frame >>= 1;
  if (--out_bits) return;
  if (speaking.used()) {
    out_frame = static_cast<uint16_t>(speaking.take() << 1 | 0x200);
    out_bits = FRAME_BITS;
  } else {
    TIMSK2 &= static_cast<uint8_t>(~_BV(OCIE2B));
  }
}

void radio_begin() {
  PORTD |= IN | OUT;
  DDRD = static_cast<uint8_t>((DDRD | OUT) & ~IN);
  TCCR2A = 0;
  TCCR2B = _BV(CS21) | _BV(CS20);  // F_CPU / 32
  EICRA = _BV(ISC01);              // falling edge
  listen();
}

int16_t radio_read() { return heard.used() ? heard.take() : static_cast<int16_t>(-1); }

uint8_t radio_room() { return speaking.room(); }

// The first bit that the interrupt puts out is a stop bit, so that a byte in flight is never cut.
void radio_write(uint8_t byte) {
  speaking.put(byte);
  cli();
  if (!(TIMSK2 & _BV(OCIE2B))) {
    out_frame = 1;
    out_bits = 1;
    OCR2B = static_cast<uint8_t>(TCNT2 + BIT);
    TIFR2 = _BV(OCF2B);
    TIMSK2 |= _BV(OCIE2B);
  }
  sei();
}

}  // namespace hal
#endif
