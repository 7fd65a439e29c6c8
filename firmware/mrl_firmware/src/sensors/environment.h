// Alcohol, light and dust: the sensors on the Uno's own inputs.  The sonar build does not have them.
#pragma once

namespace mrl {
namespace environment {

void begin();
void service();

}  // namespace environment
}  // namespace mrl
