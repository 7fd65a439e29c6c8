// An IMU of the MPU-6050 family on the I2C bus: finds it, sets it up, reads its gyro and its accelerometer when a frame
// needs them.  Nothing here waits.
#pragma once
#include <stdint.h>

#include "../board/bus.h"
#include "../hal/hal.h"
#include "../serial/rows.h"

namespace mrl {
namespace imu {

// Looks for an IMU again; only in builds with MRL_BRIDGE, when the bus has lost its pins.
void forget();
// True once it is known whether there is an IMU.
bool asked();
// Bits of the reply to 29.
int16_t capabilities();

// ---- readings, fetched when a frame needs them

void want();
// `ready` and `impossible` last until the next want().
rows::Readiness readiness();
// When the gyro was read.
uint16_t tick();
// The row of the reply to 46.
void report();

// ---- for the bus

// A quick check whether next_transfer() may return a transfer.
bool has_work();
// Fills in the next transfer of a reading.
bool next_transfer(hal::Transfer& transfer);
// Fills in a transfer that can wait: the search for the IMU, its set-up, and a look at it once in a while.
bool next_background(hal::Transfer& transfer);
void transfer_ended(bus::Result result);

}  // namespace imu
}  // namespace mrl
