// Decides which frame is sent next: answers in the order of their requests, and stream frames between them.
#pragma once
#include <stdint.h>

namespace mrl {
namespace answers {

// Queues the reply `code`; `value` is passed back when the reply is built.  The reply is dropped and counted as an
// overrun if the host sends requests faster than the serial link can carry the answers.
void ask(uint8_t code, int16_t value = 0);
// True if ask() would not drop a reply.
bool can_ask();
// Continues the frame that is being sent, or begins the next one.
void service();
// True if no frame is being sent or waiting.
bool silent();
// True if counters or the IMU are being read, or the counters of a stream will be very soon; long computations should
// then wait.
bool reading();
// True as well if an answer waits, which may need the counters; other transfers should then wait.
bool about_to_read();

}  // namespace answers
}  // namespace mrl
