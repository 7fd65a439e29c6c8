// A serial port at 9600 baud on two pins, with INT0 and timer 2.  No interrupt takes longer than 15 us, so that the USB
// port at 115200 baud, whose receiver buffers 170 us, never loses a byte.
#include "fast.h"
#include "../../build.h"
#if defined(__AVR__) && MRL_XBEE
#include <avr/interrupt.h>
#include <avr/io.h>

#include "hal.h"
#include "hal_avr.h"
#include "../../pins.h"
#include "ring.h"

namespace hal {
namespace {

static_assert(mrl::pins::XBEE_IN == 2 && mrl::pins::XBEE_OUT == 3, "D2 is INT0; both are on port D here");
constexpr uint8_t IN = _BV(PD2), OUT = _BV(PD3);

constexpr uint8_t BIT = 52;  // timer ticks of 2 us: 9615 baud
constexpr uint8_t FRAME_BITS = 10;

mrl::Ring<64> heard;
mrl::Ring<RADIO_OUT_SIZE> speaking;

// The timer makes one round per bit and never stops; its rounds are the clock of both directions.
uint8_t rounds;

// The receiver decodes bits from the times of the edges, so that a late interrupt only costs precision.
struct Moment {
  uint8_t round, tick;
};
Moment start_edge;
uint16_t in_frame;  // bits so far, the last one highest
uint8_t in_bits;
bool receiving;

uint16_t out_frame;  // bits left, the next one lowest
uint8_t out_bits;

// The interrupt that ends a round may come before or after the counter's step to 0, so this waits for the last tick.
Moment moment() {
  uint8_t tick;
  do tick = TCNT2;
  while (tick == BIT - 1);
  Moment now = {rounds, tick};
  // The round has just ended, and its interrupt is still pending.
  if ((TIFR2 & _BV(OCF2A)) && now.tick < BIT / 2) now.round++;
  return now;
}

// Bits from the start edge to `now`, rounded.
uint8_t bits_until(Moment now) {
  const uint8_t whole = static_cast<uint8_t>(now.round - start_edge.round);
  if (now.tick + BIT / 2 < start_edge.tick) return static_cast<uint8_t>(whole - 1);
  return static_cast<uint8_t>(now.tick >= start_edge.tick + BIT / 2 ? whole + 1 : whole);
}

void fill(uint8_t bits, bool high) {
  for (; in_bits < bits; in_bits++) in_frame = static_cast<uint16_t>(in_frame >> 1 | (high ? 0x200 : 0));
}

// A frame without a low start bit or a high stop bit is not valid.
void end_frame(bool high) {
  fill(FRAME_BITS, high);
  receiving = false;
  if ((in_frame & 0x201) != 0x200 || !heard.room()) return;
  heard.put(static_cast<uint8_t>(in_frame >> 1));
  tell_loop();
}

void begin_frame(Moment now) {
  start_edge = now;
  in_bits = 0;
  in_frame = 0;
  receiving = true;
}

inline void put_out_next_bit() {
  if (out_frame & 1) {
    PORTD |= OUT;
  } else {
    PORTD &= static_cast<uint8_t>(~OUT);
  }
  out_frame >>= 1;
  if (--out_bits || !speaking.used()) return;
  out_frame = static_cast<uint16_t>(speaking.take() << 1 | 0x200);
  out_bits = FRAME_BITS;
}

}  // namespace

ISR(INT0_vect) {
  const Moment now = moment();
  const bool high = PIND & IN;
  if (receiving) {
    const uint8_t bits = bits_until(now);
    if (bits >= FRAME_BITS) {
      end_frame(!high);
    } else if (high && !bits) {
      receiving = false;  // a spike
    } else {
      fill(bits, !high);
    }
  }
  if (!receiving && !high) begin_frame(now);
}

ISR(TIMER2_COMPA_vect) {
  rounds++;
  if (out_bits) put_out_next_bit();
  const bool high = PIND & IN;
  const bool edge_waits = EIFR & _BV(INTF0);  // the level is then that of the next frame's start
  if (receiving && !edge_waits && bits_until({rounds, 0}) >= FRAME_BITS) end_frame(high);
}

void radio_begin() {
  PORTD |= IN | OUT;
  DDRD = static_cast<uint8_t>((DDRD | OUT) & ~IN);
  OCR2A = BIT - 1;
  TCCR2A = _BV(WGM21);
  TCCR2B = _BV(CS21) | _BV(CS20);  // F_CPU / 32
  TIMSK2 = _BV(OCIE2A);
  EICRA = _BV(ISC00);  // both edges
  EIFR = _BV(INTF0);
  EIMSK = _BV(INT0);
}

int16_t radio_read() { return heard.used() ? heard.take() : static_cast<int16_t>(-1); }

uint8_t radio_room() { return speaking.room(); }

// The first bit sent is a stop bit: the idle level for one round starts the transmitter.
void radio_write(uint8_t byte) {
  speaking.put(byte);
  cli();
  if (!out_bits) {
    out_frame = 1;
    out_bits = 1;
  }
  sei();
}

}  // namespace hal
#endif
