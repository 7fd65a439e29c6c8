// The board's status for the host: refusals by reason, faults, reset cause, stop reason.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"

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
// A move was received since the last stop.
bool turning();
// Notes a move that is carried out.
void turned();
// Notes that the motors are stopped.
void stopped(StopReason reason);
// The host has sent a stop (13).  Other stops of its own, such as that of a new wiring, end no refusal.
void host_stopped();
// True if the board itself has stopped the motors, so that only the host's stop lets it move again; see failsafe.h.  The
// status, which has the reason, is sent.
bool refuses_move();
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
