// What an edge on an encoder's channels A and B means.
#pragma once
#include <stdint.h>

namespace mrl {
namespace quadrature {

// A state is 2 A + B, so that a step's index, 4 * the old state + the new one, has 16 values.
constexpr uint8_t STATES = 3, CHANNEL_A = 2;
constexpr uint8_t INDICES = 16;
constexpr int8_t IMPOSSIBLE = 6;

// Forward, A comes before B: the states are 0, 2, 3, 1.
constexpr uint8_t place(uint8_t state) { return static_cast<uint8_t>((state & 1) << 1 | ((state ^ state >> 1) & 1)); }

// 1 forward, -1 backward, 0 without a change, IMPOSSIBLE if both channels changed.
constexpr int8_t of_places(uint8_t passed) {
  return static_cast<int8_t>(passed == 3 ? -1 : passed == 2 ? IMPOSSIBLE : passed);
}
constexpr int8_t step(uint8_t index) { return of_places((place(index & STATES) - place(index >> 2 & STATES)) & 3); }

// Of an encoder that has channel A alone: 1 for each edge.
constexpr int8_t single_step(uint8_t index) { return (index ^ index >> 2) & CHANNEL_A ? 1 : 0; }

// Of an encoder whose channel B gives the direction, and has no interrupt: two steps for each edge of A.
constexpr int8_t directed_step(uint8_t index) {
  return static_cast<int8_t>(!single_step(index) ? 0 : (index >> 1 ^ index) & 1 ? 2 : -2);
}

static_assert(step(0 << 2 | 2) == 1 && step(1 << 2 | 0) == 1 && step(0 << 2 | 1) == -1 && step(3 << 2 | 3) == 0 &&
                  step(2 << 2 | 1) == IMPOSSIBLE,
              "the order of the states");

}  // namespace quadrature
}  // namespace mrl
