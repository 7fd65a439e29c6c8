// What the host can ask about the board's health: refusals by reason, faults, reset cause, stop reason.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace mrl {
namespace status {

// Works out the reset cause.
void begin();
// Counts a refusal.
void refuse(Reason reason);
// Counts a move beyond the ceiling.
void count_clamped();
void set_stop_reason(StopReason reason);
// Raises or clears a fault bit.  A fault that has come and gone stays visible until the host has read it.
void set_fault(int16_t bit, bool present);
// Takes the serial line's losses into the counters.
void service();
// The rows of the replies to 29, 30 and 31.
void report_protocol();
void report_status();
void report_counters();

}  // namespace status
}  // namespace mrl
