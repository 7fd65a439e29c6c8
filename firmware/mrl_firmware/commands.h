// Requests from the serial line to their handlers.
#pragma once
#include "frame_decoder.h"

namespace mrl {
namespace commands {

extern FrameDecoder decoder;

// Carries out everything that has come.
void receive();
// Forgets everything that has come.
void discard();

}  // namespace commands
}  // namespace mrl
