#include "sonar_curve.h"

#include "flash.h"

namespace mrl {
namespace {

// Straight lines between 33 points: 1.8e-4 off at most, 0.1 cm at the far end of the sonar's range.
constexpr uint8_t SEGMENT_BITS = 5;

// log2(1 + i / 32) in 1 / 65536.
const uint16_t LOG2[] PROGMEM = {
    0, 2909, 5732, 8473, 11136, 13727, 16248, 18704,
    21098, 23433, 25711, 27936, 30109, 32234, 34312, 36346,
    38336, 40286, 42196, 44068, 45904, 47705, 49472, 51207,
    52911, 54584, 56229, 57845, 59434, 60997, 62534, 64047,
    65535};

// 2^(i / 32) in 1 / 32768.
const uint16_t EXP2[] PROGMEM = {
    32768, 33486, 34219, 34968, 35734, 36516, 37316, 38133,
    38968, 39821, 40693, 41584, 42495, 43425, 44376, 45348,
    46341, 47356, 48393, 49452, 50535, 51642, 52773, 53928,
    55109, 56316, 57549, 58809, 60097, 61413, 62757, 64132,
    65535};

// The table's value at a fraction of 16 bits.
uint16_t between(const uint16_t* table, uint16_t fraction) {
  const uint16_t* at = table + (fraction >> (16 - SEGMENT_BITS));
  const uint16_t rest = static_cast<uint16_t>(fraction << SEGMENT_BITS);
  const uint16_t low = flash_uint16(at);
  const uint16_t rise = static_cast<uint16_t>(flash_uint16(at + 1) - low);
  return static_cast<uint16_t>(low + (static_cast<uint32_t>(rise) * rest >> 16));
}

// log2 of 1..65535 in 1 / 65536.
uint32_t log2_of(uint16_t value) {
  uint8_t exponent = 15;
  for (; !(value & 0x8000); value = static_cast<uint16_t>(value << 1)) exponent--;
  const uint16_t fraction = static_cast<uint16_t>(value << 1);
  return static_cast<uint32_t>(exponent) << 16 | between(LOG2, fraction);
}

constexpr int32_t ONE = 10000;  // 1 in the unit of a, b and c
constexpr int32_t FARTHEST = 1250;
constexpr uint32_t LOG2_ONE = 870838;  // log2(10000) in 1 / 65536

// b log2(s), with b in 1e-4 up to 20000, in 1 / 65536; split so that no product leaves 32 bits.
uint32_t power_of(uint32_t log2_s, uint16_t b) {
  const uint32_t high = log2_s >> 10, low = log2_s & 0x3FF;
  const uint32_t product = high * b;
  return (product / ONE << 10) + ((product % ONE << 10) + low * b) / ONE;
}

// 2^(log2 / 65536), below 65536.
uint16_t exp2_of(uint32_t log2) {
  const uint8_t exponent = static_cast<uint8_t>(log2 >> 16);
  if (exponent > 15) return UINT16_MAX;
  return static_cast<uint16_t>(between(EXP2, static_cast<uint16_t>(log2)) >> (15 - exponent));
}

}  // namespace

int16_t power_law(uint16_t count, int16_t a, int16_t b, int16_t c) {
  // Sixteenths of a cm keep the rounding fine; 65535 of them are beyond all that the wire carries.
  const uint32_t log2_a = log2_of(static_cast<uint16_t>(a)) + (4UL << 16);
  const uint32_t log2_range = power_of(log2_of(count), static_cast<uint16_t>(b)) + log2_a;
  const int32_t sixteenths = log2_range < LOG2_ONE ? 0 : exp2_of(log2_range - LOG2_ONE);
  const int32_t range = (sixteenths * (ONE / 16) + c + ONE / 2) / ONE;
  return static_cast<int16_t>(range < 0 ? 0 : range > FARTHEST ? FARTHEST : range);
}

}  // namespace mrl
