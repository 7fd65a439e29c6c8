// The sonars' power law in integers, without a division for each reading.
#pragma once
#include <stdint.h>

namespace mrl {

class PowerLaw {
 public:
  // a > 0, b >= 0 and c in 1e-4; b at most 20000.
  void set(int16_t a, int16_t b, int16_t c);
  // round(a s^b + c) for counts from 1 to 1023: within 1 of the formula, cut to 0..1250.
  int16_t at(uint16_t count) const;

 private:
  int32_t log2_a_ = 0;  // 1 / 65536
  int32_t c_ = 0;       // 1 / 32768
  uint32_t b_ = 0;      // 1 / 65536
};

}  // namespace mrl
