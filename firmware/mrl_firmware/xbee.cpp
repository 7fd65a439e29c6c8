// Texts by radio.
#include "build.h"
#include "protocol.h"
#include "status.h"

#if !MRL_XBEE

namespace mrl {
namespace handlers {

void send_xbee(const int16_t*, uint8_t) { status::refuse(Reason::unavailable); }
void discover_xbee(const int16_t*, uint8_t) { status::refuse(Reason::unavailable); }

}  // namespace handlers
}  // namespace mrl

#endif
