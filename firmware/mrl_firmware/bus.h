// The I2C bus: who is next, and what to do when it hangs.  Nothing here waits.
#pragma once
#include <stdint.h>

namespace mrl {
namespace bus {

enum class Result : uint8_t { done, refused, hung };

// Takes the clock towards the motor board and its kind of restart from the configuration.
void configure();
// Ends what is done, or has taken too long, and starts the next transfer that is urgent.
void service();
// Starts a transfer that can wait, if the bus is free.
void service_background();

}  // namespace bus
}  // namespace mrl
