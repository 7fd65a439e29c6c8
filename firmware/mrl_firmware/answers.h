// Who may speak next on the wire: answers in the order of their questions, and the stream between them.
#pragma once
#include <stdint.h>

namespace mrl {
namespace answers {

// Queues the reply `code`; `value` is what the handler wants to be reminded of.  Dropped, and counted as an overrun,
// when the host asks faster than the wire can answer.
void ask(uint8_t code, int16_t value = 0);
// True if ask() would not drop a question.
bool can_ask();
// Carries on with the frame on the wire, or begins the next one.
void service();
// True if nothing is on its way to the transmitter, nor waits to be asked for.
bool silent();
// True if counters are being read, or will be very soon: a transfer that can wait should.
bool about_to_read();

}  // namespace answers
}  // namespace mrl
