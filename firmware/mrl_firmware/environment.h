// Alcohol, light and dust: the sensors on the Uno's own inputs.  In the sonar build they are not there.
#pragma once
#include <stdint.h>

namespace mrl {
namespace environment {

void begin();
void service();
int16_t alcohol();
int16_t light();
// Particles per litre.
int16_t dust();

}  // namespace environment
}  // namespace mrl
