// CMPS10: bearing in 0.1 deg, clockwise from north.
#include "../serial/protocol.h"

namespace mrl {
namespace sensors {

// A bearing beyond the full circle is not valid.
bool compass(const uint8_t* bytes, int16_t* values) {
  const uint16_t tenths = static_cast<uint16_t>(bytes[0] << 8 | bytes[1]);
  values[0] = static_cast<int16_t>(tenths / 10);
  return tenths < 3600;
}

}  // namespace sensors
}  // namespace mrl
