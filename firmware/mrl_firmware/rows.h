// What stands in each frame that the board sends, and what has to be fetched for it.
#pragma once
#include <stdint.h>

namespace mrl {
namespace rows {

enum class Readiness : uint8_t { ready, wait, impossible };

// True if the frame carries counters that the motor board has to be asked for.
bool needs_counts(uint8_t code);
// True if sequence and board time belong to the frame.
bool is_stamped(uint8_t code);
// Asks for what else the frame carries.
void want_sensors(uint8_t code);
// Whether all but the counters is there.
Readiness readiness(uint8_t code);
// Hands the frame's numbers to the writer; `value` is what its handler wanted to be reminded of.
void report(uint8_t code, int16_t value, bool with_counts);

}  // namespace rows
}  // namespace mrl
