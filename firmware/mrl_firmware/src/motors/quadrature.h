// What an edge on an encoder's channels A and B means.
#pragma once
#include <stdint.h>

namespace mrl {
namespace quadrature {

// A state is A + 4 B, so that a step's index, the old state << 1 | the new one, has 16 values.
constexpr uint8_t CHANNELS = 5, CHANNEL_A = 1;
constexpr uint8_t INDICES = 16;
constexpr int8_t IMPOSSIBLE = 2;

// Forward, A comes before B: the states are 0, 1, 5, 4.
constexpr uint8_t place(uint8_t state) {
  return static_cast<uint8_t>((state & 4 ? 2 : 0) | ((state ^ state >> 2) & 1));
}

// 1 forward, -1 backward, 0 without a change, IMPOSSIBLE if both channels changed.
constexpr int8_t of_places(uint8_t passed) { return static_cast<int8_t>(passed == 3 ? -1 : passed); }
constexpr int8_t step(uint8_t index) {
  return of_places((place(index & CHANNELS) - place(index >> 1 & CHANNELS)) & 3);
}

// Of an encoder that has channel A alone: 1 for each edge.
constexpr int8_t single_step(uint8_t index) { return static_cast<int8_t>((index ^ index >> 1) & CHANNEL_A); }

static_assert(step(0 << 1 | 1) == 1 && step(4 << 1 | 0) == 1 && step(0 << 1 | 4) == -1 && step(5 << 1 | 5) == 0 &&
                  step(1 << 1 | 4) == IMPOSSIBLE,
              "the order of the states");

}  // namespace quadrature
}  // namespace mrl
