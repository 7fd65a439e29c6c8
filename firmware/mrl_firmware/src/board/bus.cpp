#include "../hal/fast.h"
#include "bus.h"

#include "../serial/answers.h"
#include "board_clock.h"
#include "../serial/commands.h"
#include "config.h"
#include "../hal/hal.h"
#include "../sensors/imu.h"
#include "../motors/motor.h"
#include "../sensors/sensors.h"
#include "status.h"

namespace mrl {
namespace bus {
namespace {

// The longest transfer, 10 bytes at 100 kHz, takes 1.2 ms; the rest is for slaves that stretch the clock.
constexpr uint32_t LIMIT = board_clock::of_ms(4);
constexpr uint32_t IMU_LIMIT = board_clock::of_ms(2);  // it does not stretch
constexpr uint32_t REST_AFTER_HANG = board_clock::of_ms(16);

enum class Owner : uint8_t { none, motor_board, imu, sensor } owner;
uint32_t started, rest_from;
uint8_t motor_divider;
bool resting, restart_with_stop;
bool used;           // only in builds with MRL_BRIDGE: the bus has its pins
uint32_t used_since;

void end_transfer(Result result) {
  const Owner who = owner;
  owner = Owner::none;
  status::set_fault(FAULT_BUS_HUNG, result == Result::hung);
  if (result == Result::hung) {
    hal::bus_recover();
    resting = who != Owner::imu;  // it is not asked again soon, so that the motor board need not wait
    rest_from = board_clock::now();
  }
  if (who == Owner::motor_board) motor::transfer_ended(result);
  if (who == Owner::imu || result == Result::hung) imu::transfer_ended(result);
  if (sensors::ANY && who == Owner::sensor) sensors::transfer_ended(result);
}

// True if the transfer on the bus has ended.
bool end_if_over() {
  const hal::BusState state = hal::bus_state();
  if (state == hal::BusState::idle) {
    end_transfer(Result::done);
  } else if (state == hal::BusState::nack) {
    end_transfer(Result::refused);
  } else if (state == hal::BusState::lost || board_clock::passed(started, owner == Owner::imu ? IMU_LIMIT : LIMIT)) {
    end_transfer(Result::hung);
  } else {
    return false;
  }
  return true;
}

void start(Owner who) {
  owner = who;
  hal::transfer.stop_between = restart_with_stop;
  started = board_clock::now();
  hal::bus_start();
}

bool is_free() {
  // The check of a new wiring has taken 2 ms of this pass, which would count as time of the transfer.
  if (MRL_BRIDGE && used_since == board_clock::now()) {
    board_clock::stay_awake();
    return false;
  }
  if (owner != Owner::none && !end_if_over()) return false;
  if (resting && !board_clock::passed(rest_from, REST_AFTER_HANG)) return false;
  resting = false;
  hal::transfer.divider = motor_divider;
  return true;
}

// Background transfers wait while a command arrives or a stream frame is due, unless they have waited for long.
Owner next_background(hal::Transfer& transfer) {
  const bool only_overdue = commands::decoder.in_frame() || answers::about_to_read();
  if (motor::next_poll(transfer, only_overdue)) return Owner::motor_board;
  if (only_overdue) return Owner::none;
  if (imu::next_background(transfer)) return Owner::imu;
  if (sensors::ANY && sensors::next_transfer(transfer)) return Owner::sensor;
  return Owner::none;
}

}  // namespace

void configure() {
  const uint16_t khz = static_cast<uint16_t>(config::get(Parameter::bus_speed));
  motor_divider = static_cast<uint8_t>((16000 / khz - 16 + 1) / 2);
  restart_with_stop = config::get(Parameter::bus_stop);
}

#if MRL_BRIDGE
void begin() {
  used = true;
  used_since = board_clock::now();
  hal::bus_use(true);
}

// A slave in the middle of a transfer would hold the bus when it is used again.
void end() {
  if (!used) return;
  used = false;
  if (owner != Owner::none) hal::bus_recover();
  owner = Owner::none;
  hal::bus_use(false);
  imu::forget();
}

bool in_use() { return used; }
#endif

void service() {
  if (MRL_BRIDGE && !used) return;
  if (owner == Owner::none && !motor::has_work() && !imu::has_work()) return;
  if (!is_free()) return;
  if (motor::next_transfer(hal::transfer)) return start(Owner::motor_board);
  if (imu::next_transfer(hal::transfer)) start(Owner::imu);
}

// A request that has arrived in this pass goes first.
void service_background() {
  if (MRL_BRIDGE && !used) return;
  service();
  if (!is_free()) return;
  const Owner who = next_background(hal::transfer);
  if (who != Owner::none) start(who);
}

}  // namespace bus
}  // namespace mrl
