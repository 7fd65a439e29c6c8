// The battery's voltage, through a divider on an analog input; only in builds with an H-bridge.
#pragma once
#include <stdint.h>

namespace mrl {
namespace battery {

void service();
// True while the converter works for the battery, so that the sonars must wait.
bool converting();

// False for the first 128 ms, and without a divider (parameter 24 is 0).
bool measured();
// Mean of 128 ms [0.01 V].
int16_t centivolts();

}  // namespace battery
}  // namespace mrl
