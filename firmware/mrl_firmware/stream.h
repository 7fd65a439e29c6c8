// Frames that the board repeats unasked: which one, and when the next is due.
#pragma once
#include <stdint.h>

namespace mrl {
namespace stream {

// Code of the frames, 0 while no stream runs.
uint8_t code();
// True when the next frame's values should be fetched.
bool due();
// True when they will have to be within half a millisecond.
bool almost_due();
// A frame was sent, or its values could not be had: plans the next one.
void sent();
void failed();
// The row of the reply to 17.
void report();

}  // namespace stream
}  // namespace mrl
