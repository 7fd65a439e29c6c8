// The sensors of the table.  Those on the I2C bus are read in turn in the background at 100 kHz while they are wanted.
// Those on the Uno's own pins are read when their answer is sent.  Each sensor has its own file.
#pragma once
#include <stdint.h>

#include "../board/bus.h"
#include "../hal/hal.h"
#include "../serial/protocol.h"
#include "../serial/rows.h"

namespace mrl {
namespace sensors {

#define MRL_THERE_ON_BUS(name, code, there, ...) || (there)
#define MRL_THERE_ON_PINS(name, code, there) || (there)
// Whether this build has sensors of the table.
constexpr bool ANY = false MRL_BUS_SENSORS(MRL_THERE_ON_BUS) MRL_PIN_SENSORS(MRL_THERE_ON_PINS);

// True for the codes of the sensors.
bool knows(uint8_t code);
// Requests a sensor on the bus for a command or stream; its values are kept fresh for some time after each call.
void want(uint8_t code);
// `wait` until a sensor on the bus has answered or failed since it was first wanted; values older than half a second do
// not count.
rows::Readiness readiness(uint8_t code);
// Sets the fault of a wanted sensor that did not answer the last time; one that may be absent must have answered before.
void service();
// The row of its reply.
void report(uint8_t code);
// Largest value of a sensor on the bus.
int16_t largest(uint8_t code);

// ---- for the bus
bool next_transfer(hal::Transfer& transfer);
void transfer_ended(bus::Result result);

}  // namespace sensors
}  // namespace mrl
