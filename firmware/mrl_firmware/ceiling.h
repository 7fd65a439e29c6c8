// How fast a command may move the robot: the ceilings of the configuration.
#pragma once
#include <stdint.h>

namespace mrl {
namespace ceiling {

// Both scale by the factor of the speed that is further beyond its ceiling, so that the arc keeps its radius; and count.
// Speeds in mm/s and mrad/s.
void clamp(int16_t& linear, int16_t& angular);
// Speeds of the omnidirectional mode, in % of full speed; rotation is that of the wheels.
void clamp_shares(int16_t& speed, int16_t& rotation);

}  // namespace ceiling
}  // namespace mrl
