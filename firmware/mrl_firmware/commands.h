// Passes requests from the serial line to their handlers.
#pragma once
#include "frame_decoder.h"

namespace mrl {
namespace commands {

extern FrameDecoder decoder;

// Carries out the requests that have come.
void receive();
// Drops all bytes that have come.
void discard();

}  // namespace commands
}  // namespace mrl
