// What the parts of the AVR's hardware layer have to tell each other.
#pragma once

namespace hal {

// The clock, timer 1, has to run.
void bus_begin();
void dust_begin();

}  // namespace hal
