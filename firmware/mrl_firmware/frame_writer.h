// Writes frames as bytes: one frame at a time, number by number, as far as the transmitter has room.
#pragma once
#include <stdint.h>

namespace mrl {
namespace writer {

// While on, each frame ends with its checksum, and stamped frames carry sequence number and time.
void set_checked(bool on);
bool checked();

// True when a new frame may begin.
bool idle();
// Puts "@code" out.
void begin(uint8_t code);
// Puts "@code," out, so that the wire is busy while the first number is still being fetched.
void begin_early(uint8_t code);
// Appends a number; at most MAX_ARGUMENTS - 1.
void add(int16_t value);
// Appends sequence number and board time if frames are checked.
void stamp(uint16_t tick);
// No more numbers.
void end();
// Leaves the frame unfinished, because its numbers are not available.
void abandon();
// Moves numbers into the transmitter's queue.
void service();

// Puts a line of free text out if there is room for all of it now; `first` and `second` are in flash.
void text_line(const char* first, const char* second);

}  // namespace writer
}  // namespace mrl
