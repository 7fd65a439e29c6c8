// Speed of the line to the host.
#pragma once

namespace mrl {
namespace baud {

// Changes the speed once the answer has left; at every tick of the clock.
void service();
// True from the request until the change: no stream's frame begins.
bool changing();
// True at another speed than 115200 baud.
bool raised();
// Back to 115200 baud, at once.
void reset();

}  // namespace baud
}  // namespace mrl
