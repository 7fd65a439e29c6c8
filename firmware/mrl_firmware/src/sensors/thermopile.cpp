// TPA81: eight pixels, one byte each [degC].
#include "../serial/protocol.h"

namespace mrl {
namespace sensors {

bool thermopile(const uint8_t* bytes, int16_t* values) {
  for (uint8_t i = 0; i < 8; i++) values[i] = bytes[i];
  return true;
}

}  // namespace sensors
}  // namespace mrl
