// Sends a line of text for each frame while debug is on.  A line that does not fit is dropped.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace mrl {
namespace debug {

void accepted(uint8_t code);
void refused(Reason reason);
// The row of the reply to 15.
void report();

}  // namespace debug
}  // namespace mrl
