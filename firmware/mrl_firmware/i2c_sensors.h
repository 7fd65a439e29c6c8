// TPA81 thermopile and CMPS10 compass, read in turn in the background at 100 kHz.
#pragma once
#include <stdint.h>

#include "bus.h"
#include "hal.h"

namespace mrl {
namespace i2c_sensors {

// Asks a sensor on behalf of a command or stream; values are kept fresh for a while after each call.
void want_thermopile();
void want_compass();
// False while the last value is missing or older than half a second.
bool thermopile_valid();
bool compass_valid();
// True once the sensor has answered, or failed to, since it was first wanted.
bool thermopile_known();
bool compass_known();
// True if a sensor that is wanted did not answer when it was last asked.
bool failing();

int16_t hottest();
void report_pixels();
// Degrees clockwise from north.
int16_t bearing();

// ---- for the bus
bool next_transfer(hal::Transfer& transfer);
void transfer_ended(bus::Result result);

}  // namespace i2c_sensors
}  // namespace mrl
