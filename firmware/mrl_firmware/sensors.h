// Sensors, as the table lists them: those on the I2C bus are read in turn in the background at 100 kHz while somebody
// wants them, those on the Uno's own pins are asked when their answer goes out.  What each reads stands in its file.
#pragma once
#include <stdint.h>

#include "bus.h"
#include "hal.h"
#include "rows.h"

namespace mrl {
namespace sensors {

// True for the codes of the sensors.
bool knows(uint8_t code);
// Asks a sensor on the bus, on behalf of a command or stream; its values are kept fresh for a while after each call.
void want(uint8_t code);
// `wait` until a sensor on the bus has answered, or failed to, since it was first wanted; values older than half a
// second are none.
rows::Readiness readiness(uint8_t code);
// True if a sensor that is wanted did not answer when it was last asked; one that may be absent has to have been there.
bool failing();
// The row of its reply.
void report(uint8_t code);
// Largest value of a sensor on the bus.
int16_t largest(uint8_t code);

// ---- for the bus
bool next_transfer(hal::Transfer& transfer);
void transfer_ended(bus::Result result);

}  // namespace sensors
}  // namespace mrl
