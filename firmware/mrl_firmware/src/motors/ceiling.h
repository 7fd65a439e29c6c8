// Limits the speed of commands to the ceilings of the configuration.
#pragma once
#include <stdint.h>

namespace mrl {
namespace ceiling {

// Both functions scale both speeds by the larger excess, so that the arc keeps its radius, and count the command.
// Speeds in mm/s and mrad/s.
void clamp(int16_t& linear, int16_t& angular);
// Speeds of the omnidirectional mode, in % of full speed; rotation is that of the wheels.
void clamp_shares(int16_t& speed, int16_t& rotation);

}  // namespace ceiling
}  // namespace mrl
