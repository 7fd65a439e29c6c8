// The battery's voltage, through a divider on an analog input; only in builds with an H-bridge.
#pragma once
#include <stdint.h>

namespace mrl {
namespace battery {

// The next value is known after 128 ms.
void begin();
void service();
// True while the converter works for the battery, so that the sonars must wait.
bool converting();

// Whether there is a divider (parameter 24) on a pin.
bool connected();
// False for the first 128 ms that it is connected.
bool measured();
// Mean of 128 ms [0.01 V].
int16_t centivolts();

}  // namespace battery
}  // namespace mrl
