#include "dust.h"

namespace mrl {

// The sensor's characteristic, p = 1.1 r^3 - 3.8 r^2 + 520 r particles per 0.01 cubic feet (0.2832 l) at r percent
// of the time low.  Here r is in 1/100 percent, and 0 stays 0.
int16_t dust_per_litre(uint32_t low, uint32_t total) {
  if (!total) return 0;
  const uint32_t share = low >= total ? 10000 : low * 1000 / (total / 10 ? total / 10 : 1);
  if (share > 4000) return INT16_MAX;
  const int32_t r = static_cast<int32_t>(share);
  const int32_t slope = 52000 + 11 * r * r / 1000 - 38 * r / 10;  // hundredths of particles per percent
  const int32_t particles = slope * r / 10000;
  const int32_t per_litre = particles * 10000 / 2832;
  return static_cast<int16_t>(per_litre > INT16_MAX ? INT16_MAX : per_litre);
}

}  // namespace mrl
