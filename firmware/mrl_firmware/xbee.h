// Texts by radio: an XBee Series 2 in API mode 1 on its own serial port.
#pragma once
#include <stdint.h>

namespace mrl {
namespace xbee {

void begin();
void service();
// The rows of the frames 39 and 40.
void report_text();
void report_node();

}  // namespace xbee
}  // namespace mrl
