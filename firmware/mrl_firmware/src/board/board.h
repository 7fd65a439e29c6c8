// Connects all parts of the firmware.
#pragma once

namespace mrl {
namespace board {

void begin();
// One pass of the loop; sleeps at its end if nothing is left to do.
void run();

}  // namespace board
}  // namespace mrl
