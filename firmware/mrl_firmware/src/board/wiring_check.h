// Whether the chip's pins can do what a wiring wants.  Pure: numbers in, the first problem out.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"

namespace mrl {
namespace wiring {

struct Finding {
  WiringProblem problem;
  int8_t parameter, other;  // numbers of parameters; -1 is none
};

// The first problem in the order of the problems, and of the parameters behind that; `pins` are the values from PIN_FIRST
// on.
Finding check(const int16_t* pins, Bridge bridge);

}  // namespace wiring
}  // namespace mrl
