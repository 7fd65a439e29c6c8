// Functions that the files of the AVR's hardware layer share.
#pragma once
#include <avr/io.h>

namespace hal {

// For interrupts: wakes the loop.  One instruction that changes no register and no flag.
inline void tell_loop() { GPIOR0 |= _BV(0); }
inline bool has_news() { return GPIOR0 & _BV(0); }

// Number of watchdog periods since the last kick.
extern volatile uint8_t missed_kicks;

// Needs the running clock, timer 1.
void bus_begin();
void dust_begin();
void encoders_begin();

}  // namespace hal
