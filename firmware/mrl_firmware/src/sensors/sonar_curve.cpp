#include "../hal/fast.h"
#include "sonar_curve.h"

#include "../hal/flash.h"

namespace mrl {
namespace {

// Straight lines between 65 points: the error is at most 4.4e-5, or 0.03 cm at the far end of the sonar's range.
constexpr uint8_t SEGMENT_BITS = 6;

// log2(1 + i / 64) in 1 / 65536.
const uint16_t LOG2[] PROGMEM = {
    0, 1466, 2909, 4331, 5732, 7112, 8473, 9814, 11136, 12440,
    13727, 14996, 16248, 17484, 18704, 19909, 21098, 22272, 23433, 24579,
    25711, 26830, 27936, 29029, 30109, 31178, 32234, 33279, 34312, 35334,
    36346, 37346, 38336, 39316, 40286, 41246, 42196, 43137, 44068, 44990,
    45904, 46809, 47705, 48593, 49472, 50344, 51207, 52063, 52911, 53751,
    54584, 55410, 56229, 57040, 57845, 58643, 59434, 60219, 60997, 61769,
    62534, 63294, 64047, 64794, 65535};

// 2^(i / 64) in 1 / 32768.
const uint16_t EXP2[] PROGMEM = {
    32768, 33125, 33486, 33850, 34219, 34591, 34968, 35349, 35734, 36123,
    36516, 36914, 37316, 37722, 38133, 38548, 38968, 39392, 39821, 40255,
    40693, 41136, 41584, 42037, 42495, 42958, 43425, 43898, 44376, 44859,
    45348, 45842, 46341, 46846, 47356, 47871, 48393, 48920, 49452, 49991,
    50535, 51085, 51642, 52204, 52773, 53347, 53928, 54515, 55109, 55709,
    56316, 56929, 57549, 58176, 58809, 59449, 60097, 60751, 61413, 62081,
    62757, 63441, 64132, 64830, 65535};

// The table's value at a fraction of 16 bits.
uint16_t between(const uint16_t* table, uint16_t fraction) {
  const uint16_t* at = table + (fraction >> (16 - SEGMENT_BITS));
  const uint16_t rest = static_cast<uint16_t>(fraction << SEGMENT_BITS);
  const uint16_t low = flash_uint16(at);
  const uint16_t rise = static_cast<uint16_t>(flash_uint16(at + 1) - low);
  return static_cast<uint16_t>(low + (static_cast<uint32_t>(rise) * rest >> 16));
}

// log2 of 1..65535 in 1 / 65536; 0 counts as 1.
int32_t log2_of(uint16_t value) {
  uint8_t exponent = 15;
  for (; exponent && !(value & 0x8000); value = static_cast<uint16_t>(value << 1)) exponent--;
  const uint16_t fraction = static_cast<uint16_t>(value << 1);
  return static_cast<int32_t>(static_cast<uint32_t>(exponent) << 16 | between(LOG2, fraction));
}

constexpr int32_t ONE = 10000;        // 1 in the unit of a, b and c
constexpr int32_t LOG2_ONE = 870824;  // log2(10000) in 1 / 65536
constexpr int16_t FARTHEST = 1250;
constexpr uint8_t FRACTION_BITS = 15;
constexpr int32_t UNIT = static_cast<int32_t>(1) << FRACTION_BITS;

// 2^(log2 / 65536) in 1 / 32768; at most 2^11, which is above all values in frames.
int32_t exp2_of(int32_t log2) {
  const int16_t exponent = static_cast<int16_t>(log2 >> 16);
  if (exponent < -FRACTION_BITS) return 0;
  if (exponent > 10) return UNIT << 11;
  const int32_t mantissa = between(EXP2, static_cast<uint16_t>(log2));
  return exponent < 0 ? mantissa >> -exponent : mantissa << exponent;
}

}  // namespace

void PowerLaw::set(int16_t a, int16_t b, int16_t c) {
  log2_a_ = log2_of(static_cast<uint16_t>(a)) - LOG2_ONE;
  b_ = (static_cast<uint32_t>(b) << 16) / ONE;
  c_ = c * UNIT / ONE;
}

int16_t PowerLaw::at(uint16_t count) const {
  // 20 bits times 18 bits, in two pieces that fit into 32 bits.
  const uint32_t log2_count = static_cast<uint32_t>(log2_of(count));
  const uint32_t high = log2_count >> 10, low = log2_count & 0x3FF;
  const uint32_t power = (high * b_ + (low * b_ >> 10)) >> 6;
  const int32_t log2_range = static_cast<int32_t>(power) + log2_a_;
  const int32_t range = (exp2_of(log2_range) + c_ + UNIT / 2) >> FRACTION_BITS;
  return static_cast<int16_t>(range < 0 ? 0 : range > FARTHEST ? FARTHEST : range);
}

}  // namespace mrl
