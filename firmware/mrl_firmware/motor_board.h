// The motor board on the bus: is it there, set it up, hand it commands, read its counters.  Nothing here waits.
#pragma once
#include <stdint.h>

#include "bus.h"
#include "hal.h"
#include "motor_message.h"
#include "protocol.h"

namespace mrl {
namespace motor {

// Asks for the board; it is stopped and set up as soon as it answers, and again whenever it comes back.
void begin();
void service();

// False when the board does not answer.
bool available();
// True once it is known whether the board is there.
bool asked();
// True if it has answered since the start.
bool ever_found();

// Stops the motors ahead of everything else, and drops the moves that wait.
void stop(StopReason reason);
// Queues a command; false if the board is not available.
bool send(const Message& message);
// Tells the board a parameter that has changed.
void refresh(Parameter parameter);
void refresh_all();

// ---- counters, read on demand

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

// A quick look whether next_transfer() may have something.
bool has_work();
// Fills in what has to be sent now; false if nothing.
bool next_transfer(hal::Transfer& transfer);
// Fills in a battery or temperature read, which can wait; `overdue` tells that it has waited for long.
bool next_poll(hal::Transfer& transfer, bool only_overdue);
void transfer_ended(bus::Result result);

}  // namespace motor
}  // namespace mrl
