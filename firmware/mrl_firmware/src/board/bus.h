// The I2C bus: selects the next transfer, and frees a bus that hangs.  Nothing here waits.
#pragma once
#include <stdint.h>

namespace mrl {
namespace bus {

enum class Result : uint8_t { done, refused, hung };

// Takes the motor board's clock and kind of restart from the configuration.
void configure();
// Takes the bus's pins, or leaves them; only in builds with MRL_BRIDGE, others have them from the start.
void begin();
void end();
bool in_use();
// Ends a transfer that is done or has taken too long, and starts the next urgent transfer.
void service();
// Starts a background transfer if the bus is free.
void service_background();

}  // namespace bus
}  // namespace mrl
