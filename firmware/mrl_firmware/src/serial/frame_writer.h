// Writes frames as bytes: one frame at a time, number by number, as far as the transmitter has room.
#pragma once
#include <stdint.h>

namespace mrl {
namespace writer {

// While on, each frame ends with its checksum, and stamped frames carry sequence number and time.
void set_checked(bool on);

// True when a new frame may begin.
bool idle();
// Sends "@code".
void begin(uint8_t code);
// Sends "@code,", so that the serial link is busy while the first number is still being fetched.
void begin_early(uint8_t code);
// Appends a number; at most MAX_ARGUMENTS - 1.
void add(int16_t value);
// Appends sequence number and board time if frames are checked.
void stamp(uint16_t tick);
// Ends the frame: no more numbers.
void end();
// Leaves the frame unfinished, because its numbers are not available.
void abandon();
// Moves numbers into the transmitter's queue.
void service();

// Sends a line of free text if there is room for all of it now; `first` and `second` are in flash.
void text_line(const char* first, const char* second);

}  // namespace writer
}  // namespace mrl
