// What stops the robot when nobody tells it to: silence on the link, a stalled loop, the end of check mode.
#pragma once
#include <stdint.h>

namespace mrl {
namespace failsafe {

// A frame came that the table allows.
void valid_frame();
// `gap` is the time since the last pass of the loop [64 us].
void service(uint16_t gap);
// The row of the reply to 33.
void report_watchdog();

}  // namespace failsafe
}  // namespace mrl
