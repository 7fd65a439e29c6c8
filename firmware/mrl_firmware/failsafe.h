// Stops the robot without a request: on silence on the link, a stalled loop, or the end of checksum mode.
#pragma once
#include <stdint.h>

namespace mrl {
namespace failsafe {

// Notes that a valid frame has arrived.
void valid_frame();
// `gap` is the time since the last pass of the loop [64 us].
void service(uint16_t gap);
// The row of the reply to 33.
void report_watchdog();

}  // namespace failsafe
}  // namespace mrl
