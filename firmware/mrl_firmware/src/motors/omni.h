// Robots with three omni wheels: the omnidirectional mode of their motor board, and the third encoder.
#pragma once

namespace mrl {
namespace omni {

// Right, left, rear.
void report_encoders();

}  // namespace omni
}  // namespace mrl
