// The stream: which frame the board repeats, and when the next one is due.
#pragma once
#include <stdint.h>

namespace mrl {
namespace stream {

// Code of the frames, 0 while no stream runs.
uint8_t code();
// True when the next frame's values should be fetched.
bool due();
// True if they should be fetched within half a millisecond.
bool almost_due();
// Plans the next frame after one was sent, or its values were not available.
void sent();
void failed();
// The row of the reply to 17.
void report();

}  // namespace stream
}  // namespace mrl
