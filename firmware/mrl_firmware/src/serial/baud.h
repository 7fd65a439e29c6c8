// Baud rate of the serial link to the host.
#pragma once

namespace mrl {
namespace baud {

// Changes the baud rate after the answer has been sent.
void service();
// True from the request until the change; no stream frame begins during this time.
bool changing();
// True at another baud rate than 115200.
bool raised();
// Returns to 115200 baud at once.
void reset();

}  // namespace baud
}  // namespace mrl
