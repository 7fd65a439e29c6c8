#include "omni.h"

#include "ceiling.h"
#include "../serial/frame_writer.h"
#include "motor.h"
#include "../serial/protocol.h"
#include "../board/status.h"

namespace mrl {
namespace omni {

void report_encoders() {
  const motor::Counts& counts = motor::counts();
  writer::add(counts.right);
  writer::add(counts.left);
  writer::add(counts.rear);
}

}  // namespace omni

namespace handlers {

void move_omni(const int16_t* args, uint8_t) {
  if (!(motor::capabilities() & CAPABILITY_OMNI)) return status::refuse(Reason::unavailable);
  int16_t speed = args[0], rotation = args[1];
  ceiling::clamp_shares(speed, rotation);
  if (!motor::move_omni(static_cast<uint8_t>(speed), rotation, args[2])) status::refuse(Reason::unavailable);
}

}  // namespace handlers
}  // namespace mrl
