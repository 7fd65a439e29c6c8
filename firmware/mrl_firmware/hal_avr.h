// Functions that the files of the AVR's hardware layer share.
#pragma once

namespace hal {

// Needs the running clock, timer 1.
void bus_begin();
void dust_begin();

}  // namespace hal
