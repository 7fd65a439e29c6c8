// Texts by radio: an XBee Series 2 in API mode 1 on its own serial port.
#pragma once
#include <stdint.h>

namespace mrl {
namespace xbee {

constexpr uint8_t ADDRESS_SIZE = 8;

void begin();
void service();
// The XBee reports the delivery of a text with an id.
constexpr uint8_t FRAME_ID = 1, NO_FRAME_ID = 0;
// Sends a text; false if the radio is still sending.
bool send(const uint8_t* address, const uint8_t* text, uint8_t size, uint8_t frame_id);
// The rows of the frames 39, 40 and 49.
void report_text();
void report_node();
void report_radio();
// Adds the four numbers of an address.
void report_address(const uint8_t* address);

}  // namespace xbee
}  // namespace mrl
