// The board's status for the host: refusals by reason, faults, reset cause, stop reason.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace mrl {
namespace status {

// Determines the reset cause.
void begin();
// One more, at most INT16_MAX.
void count(int16_t& counter);
// Counts a refusal.
void refuse(Reason reason);
// Counts a move beyond the speed ceiling.
void count_clamped();
void set_stop_reason(StopReason reason);
// Sets or clears a fault bit.  A cleared fault stays visible until the host has read it.
void set_fault(int16_t bit, bool present);
// Adds the bytes lost at the serial port to the counters.
void service();
// The rows of the replies to 29, 30 and 31.
void report_protocol();
void report_status();
void report_counters();

}  // namespace status
}  // namespace mrl
