// The board's parameters: defaults by model, EEPROM with a checksum, changes by the host.
//
// EEPROM: the robot id is a 4-byte float at address 0, where the firmware of 2013 keeps it.  BLOCK_AT starts a block:
// layout version, the parameters of all boards (id included) as int16, low byte first, and the CRC-16 of the block.  With
// MRL_BRIDGE, PINS_AT starts a second one: layout version, the wiring as int8, and its CRC-16.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"

namespace mrl {
namespace config {

constexpr uint16_t ID_AT = 0;
constexpr uint16_t BLOCK_AT = 16;
constexpr uint8_t LAYOUT = 5;  // other layouts are not read
constexpr uint8_t BLOCK_SIZE = 1 + 2 * PARAMETER_COUNT + 2;
constexpr uint16_t PINS_AT = 96;
constexpr uint8_t PINS_LAYOUT = 1;

// Loads the EEPROM; damaged values are replaced by the model's defaults, and a fault is set.
void begin();
int16_t get(Parameter parameter);
// The values from PIN_FIRST on; only in builds with MRL_BRIDGE.
const int8_t* pins();
// For the handlers that set gains; the value must be in the parameter's range.
void set(Parameter parameter, int16_t value);
// Writes at most one byte to EEPROM.
void service();
// Adds the numbers of the replies to 34 and 35.
void report(int16_t index);

}  // namespace config
}  // namespace mrl
