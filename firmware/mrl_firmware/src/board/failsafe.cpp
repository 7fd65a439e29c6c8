#include "failsafe.h"

#include "../serial/answers.h"
#include "../serial/baud.h"
#include "board_clock.h"
#include "../serial/commands.h"
#include "../serial/frame_writer.h"
#include "../motors/motor.h"
#include "../serial/protocol.h"

namespace mrl {
namespace failsafe {
namespace {

constexpr uint16_t STALL = static_cast<uint16_t>(board_clock::of_ms(250));
constexpr uint32_t CHECK_SILENCE = board_clock::of_ms(2000);
constexpr uint32_t BAUD_SILENCE = board_clock::of_ms(1000);

uint32_t last_valid;
uint32_t watchdog;  // [64 us], 0 is off
int16_t watchdog_ms;
bool final;   // see stops_are_final()
bool silent;  // the watchdog has stopped the motors, and no valid frame has arrived since

void set_check(bool on) {
  commands::decoder.checked = on;
  writer::set_checked(on);
}

// Requests that waited during a stall are stale and are not carried out.
void recover_from_stall() {
  commands::discard();
  motor::stop(StopReason::stall);
  last_valid = board_clock::now();
}

}  // namespace

void valid_frame() {
  last_valid = board_clock::now();
  silent = false;
}

void service(uint16_t gap) {
  if (gap > STALL) recover_from_stall();
  if (watchdog && !silent && board_clock::passed(last_valid, watchdog)) {
    silent = true;
    motor::stop(StopReason::link_watchdog);
  }
  if (baud::raised() && board_clock::passed(last_valid, BAUD_SILENCE)) baud::reset();
  if (commands::decoder.checked && board_clock::passed(last_valid, CHECK_SILENCE)) {
    motor::stop(StopReason::check_ended);
    set_check(false);
  }
}

bool host_lost() { return board_clock::now() - last_valid >= CHECK_SILENCE; }

bool stops_are_final() { return final; }

void report_watchdog() { writer::add(watchdog_ms); }

}  // namespace failsafe

namespace handlers {

void set_check(const int16_t* args, uint8_t) {
  failsafe::set_check(args[0]);
  commands::decoder.asked = args[0];
  failsafe::final = failsafe::final && args[0];
  for (uint8_t encoder = 1; encoder <= 3; encoder++) motor::set_prescaler(encoder, 0);  // not that of another host
  answers::ask(SET_CHECK, args[0]);
}

void set_watchdog(const int16_t* args, uint8_t) {
  failsafe::watchdog_ms = args[0];
  failsafe::final = args[0];
  failsafe::watchdog = board_clock::of_ms(static_cast<uint32_t>(args[0]));
  answers::ask(SET_WATCHDOG);
}

}  // namespace handlers
}  // namespace mrl
