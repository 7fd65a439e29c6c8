// The robot's motors and their encoders.  build.h selects the back end: motor_omni3md.cpp or
// motor_bridge.cpp.  Nothing here waits.
#pragma once
#include <stdint.h>

#include "../board/bus.h"
#include "../hal/hal.h"
#include "../serial/protocol.h"

namespace mrl {
namespace motor {

void begin();
void service();

// False if the motors do not answer.
bool available();
// True once it is known whether there are motors.
bool asked();
// True if they have answered since the start.
bool ever_found();

// Takes over a changed parameter.
void refresh(Parameter parameter);
void refresh_all();

// ---- moves and encoders; each returns false if it is not available

// Speeds forward and to the left [mm/s], and angular speed [mrad/s].
bool move_twist(int16_t forward, int16_t left, int16_t angular);
// Percent of full speed if `controlled`, otherwise of full duty.
bool move_percent(int16_t left, int16_t right, bool controlled);
// Percent of full duty of each of four motors.
bool move_wheels(const int16_t* percents);
// Turns motor 1 (left), 2 (rear) or 3 (right) at `speed` [%] to a counter value, and holds it there.
bool move_position(uint8_t motor, int16_t speed, int16_t position);
// Three omni wheels: speed and rotation [%], direction [deg].
bool move_omni(uint8_t speed, int16_t rotation, int16_t direction);
// Lets the motor board measure its motors, which turns them.
bool calibrate();
// Encoders have the numbers of their motors.  A count takes 10^`value` pulses; false without this encoder.
bool set_prescaler(uint8_t encoder, uint8_t value);
bool preset_encoder(uint8_t encoder, int16_t count);
bool reset_encoders();

// Stops the motors before everything else, and drops waiting moves.
void stop(StopReason reason);

// ---- counters, read when a frame needs them

enum class CountsState : uint8_t { idle, wanted, reading, ready, failed };
struct Counts {
  int16_t right, left, rear;
  uint16_t tick;  // when they were latched
};
void want_counts();
// `ready` and `failed` last until the next want_counts().
CountsState counts_state();
const Counts& counts();

// ---- rows

// What hosts must know of these motors: bits of the reply to 29.
int16_t capabilities();
// The row of the reply to 5.
void report_info();
// Adds the counters of the wheels to the reply to 54.
void report_wheels();
// Adds what only some motors have to the reply to 30.
void report_status();

// ---- for the bus; motors on the Arduino's pins need no transfer

// A quick check whether next_transfer() may return a transfer.
bool has_work();
// Fills in the transfer that must be sent now; false if there is none.
bool next_transfer(hal::Transfer& transfer);
// Fills in a battery or temperature read, which can wait; with `only_overdue`, only if it has waited for long.
bool next_poll(hal::Transfer& transfer, bool only_overdue);
void transfer_ended(bus::Result result);

}  // namespace motor
}  // namespace mrl
