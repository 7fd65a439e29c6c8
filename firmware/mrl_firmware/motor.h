// The motor board on the bus: finds it, sets it up, sends commands, reads its counters.  Nothing here waits.
#pragma once
#include <stdint.h>

#include "bus.h"
#include "hal.h"
#include "omni3md_message.h"
#include "protocol.h"

namespace mrl {
namespace motor {

// Looks for the board; it is stopped and set up as soon as it answers, and each time it comes back.
void begin();
void service();

// False when the board does not answer.
bool available();
// True once it is known whether the board is there.
bool asked();
// True if it has answered since the start.
bool ever_found();

// Stops the motors before all other commands, and drops waiting moves.
void stop(StopReason reason);
// Queues a command; false if the board is not available.
bool send(const Message& message);
// Sends a changed parameter to the board.
void refresh(Parameter parameter);
void refresh_all();

// ---- counters, read when a frame needs them

enum class CountsState : uint8_t { idle, wanted, reading, ready, failed };
struct Counts {
  int16_t right, left, rear;
  uint16_t tick;  // when the board latched them
};
void want_counts();
// `ready` and `failed` last until the next want_counts().
CountsState counts_state();
const Counts& counts();

// The row of the reply to 5.
void report_info();

// ---- for the bus

// A quick check whether next_transfer() may return a transfer.
bool has_work();
// Fills in the transfer that must be sent now; false if there is none.
bool next_transfer(hal::Transfer& transfer);
// Fills in a battery or temperature read, which can wait; with `only_overdue`, only if it has waited for long.
bool next_poll(hal::Transfer& transfer, bool only_overdue);
void transfer_ended(bus::Result result);

}  // namespace motor
}  // namespace mrl
