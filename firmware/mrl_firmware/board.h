// Connects all parts of the firmware.
#pragma once

namespace mrl {
namespace board {

void begin();
// One pass of the loop; returns without waiting for anything.
void run();

}  // namespace board
}  // namespace mrl
