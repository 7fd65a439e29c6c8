// Passes requests from the serial port to their handlers.
#pragma once
#include "frame_decoder.h"

namespace mrl {
namespace commands {

extern FrameDecoder decoder;

// Carries out the requests that have arrived.
void receive();
// Drops all bytes that have arrived.
void discard();

}  // namespace commands
}  // namespace mrl
