#include "status.h"

#include "../serial/answers.h"
#include "board_clock.h"
#include "../../build.h"
#include "../serial/debug.h"
#include "failsafe.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../radio/hold.h"
#include "../sensors/imu.h"
#include "../motors/motor.h"

namespace mrl {
namespace status {
namespace {

constexpr int16_t CAPABILITIES = CAPABILITY_CHECK | CAPABILITY_WATCHDOG | CAPABILITY_PERIOD | CAPABILITY_CONFIG |
                                 CAPABILITY_BAUD |
                                 (MRL_ENVIRONMENT ? CAPABILITY_ENVIRONMENT : CAPABILITY_SONARS) |
                                 (MRL_XBEE ? CAPABILITY_XBEE | CAPABILITY_HOLD : 0);

int16_t counters[REASON_COUNT];
int16_t clamped;
int16_t present_faults, unread_faults;
ResetCause reset_cause;
StopReason stop_reason;
bool moving;       // a move was received since the last stop
bool own_stop;     // the board itself has stopped the motors since the last move or stop (13)

// The interrupt's mark survives a bootloader that clears the chip's flags; kept RAM means a reset, not a power-on.
ResetCause cause_of(const hal::ResetTrace& trace) {
  if (trace.power_on) return ResetCause::power_on;
  if (trace.watchdog_marked || trace.watchdog) return ResetCause::watchdog;
  if (trace.brown_out) return ResetCause::brown_out;
  if (trace.external || trace.memory_kept) return ResetCause::external;
  return ResetCause::power_on;
}

}  // namespace

void count(int16_t& counter) {
  if (counter != INT16_MAX) counter++;
}

void begin() {
  reset_cause = cause_of(hal::reset_trace());
  stop_reason = StopReason::boot;
}

void refuse(Reason reason) {
  count(counters[static_cast<uint8_t>(reason)]);
  debug::refused(reason);
}

void count_clamped() { count(clamped); }

bool turning() { return moving; }

// A second stop for the same reason is seen as one, because the reason is none in between.
void turned() {
  if (!moving) stop_reason = StopReason::none;
  moving = true;
  own_stop = false;
}

// If the motors were not turning, the reason of the previous stop stays.
void stopped(StopReason reason) {
  if (moving) stop_reason = reason;
  own_stop = own_stop || (moving && reason != StopReason::host);
  moving = false;
}

void host_stopped() { own_stop = false; }

bool refuses_move() {
  if (!own_stop || !failsafe::stops_are_final()) return false;
  if (answers::can_ask()) answers::ask(READ_STATUS);
  return true;
}

void set_fault(int16_t bit, bool present) {
  if (present) {
    unread_faults |= static_cast<int16_t>(bit & ~present_faults);
    present_faults |= bit;
  } else {
    present_faults &= static_cast<int16_t>(~bit);
  }
}

void service() {
  for (uint8_t lost = hal::serial_overruns(); lost; lost--) count(counters[static_cast<uint8_t>(Reason::overrun)]);
}

void report_protocol() {
  writer::add(PROTOCOL_VERSION);
  writer::add(CAPABILITIES | motor::capabilities() | imu::capabilities());
}

void report_status() {
  const uint32_t uptime = board_clock::uptime_s();
  writer::add(static_cast<int16_t>(uptime >> 15));
  writer::add(static_cast<int16_t>(uptime & 0x7FFF));
  writer::add(static_cast<int16_t>(reset_cause));
  writer::add(static_cast<int16_t>(stop_reason));
  writer::add(present_faults | unread_faults);
  writer::add(clamped);
  motor::report_status();
  unread_faults = 0;
}

void report_counters() {
  const uint8_t count = hold::on() ? REASON_COUNT : REASON_COUNT - 1;  // a host before holds knows one less
  for (uint8_t i = 0; i < count; i++) writer::add(counters[i]);
}

}  // namespace status
}  // namespace mrl
