// Alcohol, light and dust: the sensors on the Uno's own inputs; only in builds with MRL_ENVIRONMENT.
#pragma once

namespace mrl {
namespace environment {

void begin();
void service();
// True after a minute without a pulse of the dust sensor.
bool silent();

}  // namespace environment
}  // namespace mrl
