// Alcohol, light and dust: the sensors on the Uno's own inputs.  In the sonar build they are not there.
#pragma once

namespace mrl {
namespace environment {

void begin();
void service();

}  // namespace environment
}  // namespace mrl
