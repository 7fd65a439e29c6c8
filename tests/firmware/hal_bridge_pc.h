// The H-bridge and the encoders of the firmware on a PC; hal_pc.cpp moves their time.
#pragma once
#include <stdint.h>

#include "hal_pc.h"

namespace bridge_pc {

// Reads the encoders' lines as they are; the first sample comes after one period.
void begin(const PcWorld& world, double now_us, uint16_t tick);
// Edges and samples up to a time; true if that is news for the loop.
bool pass_time(double now_us);
// The loop kicks the watchdog.
void kick(double now_us);
// The level of a line that nothing on the board drives.
bool level(int pin);
// True if the loop has written another level or taken a sample since the last call.
bool take_action();

}  // namespace bridge_pc
