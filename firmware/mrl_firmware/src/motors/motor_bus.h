// A motor board on the I2C bus: the transfers it needs.  Motors that are not on the bus never need one.
#pragma once
#include "../board/bus.h"
#include "../hal/hal.h"

namespace mrl {
namespace motor {

// A quick check whether next_transfer() may return a transfer.
bool has_work();
// Fills in the transfer that must be sent now; false if there is none.
bool next_transfer(hal::Transfer& transfer);
// Fills in a battery or temperature read, which can wait; with `only_overdue`, only if it has waited for long.
bool next_poll(hal::Transfer& transfer, bool only_overdue);
void transfer_ended(bus::Result result);

}  // namespace motor
}  // namespace mrl
