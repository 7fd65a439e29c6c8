// Robots with three omni wheels: the motor board's own omnidirectional mode, and its third encoder.
#pragma once

namespace mrl {
namespace omni {

// Right, left, rear.
void report_encoders();

}  // namespace omni
}  // namespace mrl
