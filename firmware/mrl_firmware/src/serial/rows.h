// The contents of each frame that the board sends, and the values that must be fetched for it.
#pragma once
#include <stdint.h>

namespace mrl {
namespace rows {

enum class Readiness : uint8_t { ready, wait, impossible };

// True if the frame carries counters, which must be fetched for it.
bool needs_counts(uint8_t code);
// True if the frame has a sequence number and the board time.
bool is_stamped(uint8_t code);
// True if the request has a reply, which has neither.
bool is_answered(uint8_t code);
// Requests the other values of the frame.
void want_sensors(uint8_t code);
// Whether all values except the counters are available.
Readiness readiness(uint8_t code);
// Passes the frame's numbers to the writer; `value` is the one given to answers::ask().
void report(uint8_t code, int16_t value, bool with_counts);

}  // namespace rows
}  // namespace mrl
