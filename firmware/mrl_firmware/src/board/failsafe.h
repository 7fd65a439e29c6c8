// Stops the robot without a request: on silence on the link, a stalled loop, or the end of checksum mode.
#pragma once
#include <stdint.h>

namespace mrl {
namespace failsafe {

// Notes that a valid frame has arrived.
void valid_frame();
// `gap` is the time since the last pass of the loop [64 us].
void service(uint16_t gap);
// Whether no valid frame has arrived for 2 s.
bool host_lost();
// Whether the board refuses moves after a stop that the host did not order, until the host orders one.  This begins when
// the host turns the watchdog on and ends when it turns watchdog or checksums off, so that hosts of 2013 never see it.
// Silence does not end it, because a move that the line held up may arrive after the silence.
bool stops_are_final();
// The row of the reply to 33.
void report_watchdog();

}  // namespace failsafe
}  // namespace mrl
