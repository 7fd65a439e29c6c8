// Alcohol, light and dust: the sensors on the Uno's own inputs; only in builds with MRL_ENVIRONMENT.
#pragma once
#include <stdint.h>

namespace mrl {

// Particles of 1 um and larger per litre, for `low` out of `total` ticks (at most 2^22) in which the PPD42NS holds its
// output low; 32767 at most.
int16_t dust_per_litre(uint32_t low, uint32_t total);

namespace environment {

void begin();
void service();
// True after a minute without a pulse of the dust sensor.
bool silent();

}  // namespace environment
}  // namespace mrl
