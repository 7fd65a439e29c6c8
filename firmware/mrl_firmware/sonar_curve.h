// The sonars' power law in integers.
#pragma once
#include <stdint.h>

namespace mrl {

// round(a s^b + c), with a and c in 1e-4, b in 1e-4, for counts from 1 to 1023; within 1 of the formula, between
// 0 and 1250.
int16_t power_law(uint16_t count, int16_t a, int16_t b, int16_t c);

}  // namespace mrl
