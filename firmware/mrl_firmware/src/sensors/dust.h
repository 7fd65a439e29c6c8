// Dust concentration from the time the PPD42NS holds its output low.
#pragma once
#include <stdint.h>

namespace mrl {

// Particles of 1 um and larger per litre, for `low` out of `total` ticks (at most 2^22); 32767 at most.
int16_t dust_per_litre(uint32_t low, uint32_t total);

}  // namespace mrl
