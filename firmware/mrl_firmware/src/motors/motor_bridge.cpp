// Two motors on an H-bridge and two encoders, all on the Arduino's pins: turns requests into commands to the wheels,
// and serves one wheel in each pass of the loop.
#include "../../build.h"

#if MRL_BRIDGE

#include "../sensors/battery.h"
#include "../board/board_clock.h"
#include "bridge.h"
#include "../board/config.h"
#include "encoder_counter.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "motor.h"
#include "../board/status.h"
#include "wheel.h"
#include "wheel_settings.h"
#include "../board/wiring.h"

namespace mrl {
namespace motor {
namespace {

enum Side : uint8_t { LEFT, RIGHT, SIDES };
constexpr uint8_t LEFT_MOTOR = 1, RIGHT_MOTOR = 3;  // their numbers in the protocol

constexpr uint32_t REFUSED_FOR = board_clock::of_ms(1000);  // after the chip has stopped a wheel

WheelSettings settings;
Wheel wheels[SIDES];
EncoderCounter counters[SIDES];
hal::EncoderSample sample, live;
uint16_t last_counts[SIDES];
uint8_t to_serve;  // halves of wheels that have not been served with this sample
bool single[SIDES];  // the encoder has channel A alone
Counts frame_counts;
uint32_t refused_since;
bool usable;   // bridge, wiring and numbers are set
bool refused;  // moves, since the chip has stopped a wheel
bool undervoltage;

Bridge chip() { return static_cast<Bridge>(config::get(Parameter::bridge)); }

bool wired(int16_t bits) { return config::get(Parameter::wiring) & bits; }

// ---- wires: the motor that drives a wheel, and the encoder that it turns

uint8_t motor_of(uint8_t wheel) { return wired(WIRING_MOTORS_SWAPPED) ? wheel ^ 1 : wheel; }

uint8_t encoder_of(uint8_t wheel) { return wired(WIRING_ENCODERS_SWAPPED) ? wheel ^ 1 : wheel; }

bool motor_reversed(uint8_t wheel) { return wired(wheel ? WIRING_RIGHT_MOTOR_REVERSED : WIRING_LEFT_MOTOR_REVERSED); }

bool encoder_reversed(uint8_t wheel) {
  return wired(wheel ? WIRING_RIGHT_ENCODER_REVERSED : WIRING_LEFT_ENCODER_REVERSED);
}

// A single channel counts up; its direction is that of the command.
int16_t oriented(uint8_t wheel, int16_t counts) {
  const bool back = single[wheel] ? wheels[wheel].last_direction() < 0 : encoder_reversed(wheel);
  return static_cast<int16_t>(back ? -counts : counts);
}

// All three pins each time: after a missed kick of the chip's watchdog they are low.
void write(uint8_t wheel) {
  const int16_t level = wheels[wheel].level();
  const bool backward = (wheels[wheel].last_direction() < 0) != motor_reversed(wheel);
  const uint8_t duty = static_cast<uint8_t>(level < 0 ? -level : level);
  const bridge::Levels pins =
      bridge::levels(usable ? chip() : Bridge::unset, backward, duty, config::get(Parameter::stop_mode));
  hal::bridge_write(motor_of(wheel), {pins.pwm_a, pins.pwm_b, pins.logic});
}

// ---- stops

void stop_for(StopReason reason) {
  stop(reason);
  refused = true;
  refused_since = board_clock::now();
}

// A battery that has recovered without load must be a sixteenth above the limit.
void watch_battery() {
  const int16_t least = config::get(Parameter::undervoltage), volts = battery::centivolts();
  const bool watched = least && battery::measured();
  if (watched && volts < least && !undervoltage) {
    undervoltage = true;
    stop(StopReason::undervoltage);
  }
  if (!watched || volts >= least + least / 16) undervoltage = false;
}

bool allowed() {
  if (refused && board_clock::passed(refused_since, REFUSED_FOR)) refused = false;
  return usable && !refused && !undervoltage;
}

// For each move: whether it may begin.  A masked encoder gets another chance.
__attribute__((noinline)) bool begin_move(bool moves) {
  if (status::refuses_move()) return false;
  if (!moves) refused = false;
  if (!allowed()) return false;
  for (uint8_t i = 0; i < SIDES; i++) {
    if (hal::encoder_masked(i)) hal::encoder_unmask(i);
  }
  status::turned();
  return true;
}

// ---- periods

__attribute__((noinline)) int16_t moved_by(uint8_t wheel, const hal::EncoderSample& now) {
  const uint8_t encoder = encoder_of(wheel);
  const int16_t counts = static_cast<int16_t>(now.count[encoder] - last_counts[encoder]);
  return oriented(wheel, counts);
}

void serve(uint8_t wheel) {
  const uint8_t encoder = encoder_of(wheel);
  const int16_t moved = moved_by(wheel, sample);
  last_counts[encoder] = sample.count[encoder];
  const StopReason reason = wheels[wheel].update(settings, moved, sample.edge_tick[encoder], sample.tick);
  if (reason != StopReason::none) stop_for(reason);
}

// ---- moves

// Of -100 to 100: the table has no other percentages.
int16_t share_of(int16_t percent) {
  return static_cast<int16_t>(static_cast<int32_t>(percent) * 10486 / 64);  // * FULL / 100
}

// If a wheel would be faster than it can be, both slow down by the same factor, which keeps the arc.
void set_speeds(int32_t left, int32_t right) {
  const int32_t left_size = left < 0 ? -left : left, right_size = right < 0 ? -right : right;
  const int32_t most = left_size > right_size ? left_size : right_size;
  if (most > FULL) {
    const int32_t factor_q14 = (static_cast<int32_t>(FULL) << 14) / most;
    left = left / 16 * factor_q14 / 1024;
    right = right / 16 * factor_q14 / 1024;
  }
  wheels[LEFT].set_speed(static_cast<int16_t>(left));
  wheels[RIGHT].set_speed(static_cast<int16_t>(right));
}

bool take_settings() {
  return wiring::accepted() && wired(WIRING_SET) && settings.configure();
}

void take_channels() {
  hal::encoder_single_channel(wired(WIRING_SINGLE_CHANNEL));
  for (uint8_t wheel = LEFT; wheel < SIDES; wheel++) {
    const Parameter b = encoder_of(wheel) ? Parameter::pin_right_encoder_b : Parameter::pin_left_encoder_b;
    single[wheel] = wired(WIRING_SINGLE_CHANNEL) || wiring::pin(b) == NOT_CONNECTED;
  }
}

// The travel at this moment, beyond the last sample.
__attribute__((noinline)) int32_t travel_of(uint8_t wheel) {
  hal::encoder_read(live);
  return wheels[wheel].travel() + moved_by(wheel, live);
}

bool is_side(uint8_t motor) { return motor == LEFT_MOTOR || motor == RIGHT_MOTOR; }

uint8_t side_of(uint8_t motor) { return motor == LEFT_MOTOR ? LEFT : RIGHT; }

}  // namespace

void begin() { refresh_all(); }

// A stop may come between the control of a wheel and its output.  A line that oscillates may have cost the chip the host's stop, so this does not wait for the next sample.
void service() {
  if (status::turning() && (hal::encoder_masked(LEFT) || hal::encoder_masked(RIGHT))) stop_for(StopReason::encoder);
  if (!to_serve && hal::encoder_sample(sample)) {
    to_serve = 2 * SIDES;
    watch_battery();
  }
  if (!to_serve) return;
  const uint8_t wheel = to_serve > SIDES ? LEFT : RIGHT;
  if (to_serve-- % 2) {
    write(wheel);
  } else {
    serve(wheel);
  }
  if (to_serve) board_clock::stay_awake();
}

// Motors on the Arduino's own pins can always be stopped; moves say for themselves whether they are available.
bool available() { return true; }
bool asked() { return true; }
bool ever_found() { return true; }

// The pins are inputs, and the wheels stop, before anything means something else.
void refresh(Parameter parameter) {
  const bool wires = wiring::depends_on(parameter), meanings = wires || parameter == Parameter::wiring;
  if (wires) wiring::end();
  if (meanings) stop(StopReason::host);
  if (wires) wiring::begin();
  if (meanings) take_channels();
  usable = take_settings();
  if (!usable) stop(StopReason::host);
  status::set_fault(FAULT_WIRING, !usable);
}

void refresh_all() { refresh(Parameter::bridge); }

bool move_speed(int16_t linear, int16_t angular) {
  if (!begin_move(linear || angular)) return false;
  const int32_t ahead = (static_cast<int32_t>(linear) * settings.share_per_mm_s_q8 + 128) >> 8;
  const int32_t turn = (static_cast<int32_t>(angular) * settings.share_per_mrad_s_q12 + 2048) >> 12;
  set_speeds(ahead - turn, ahead + turn);
  return true;
}

bool move_percent(int16_t left, int16_t right, bool controlled) {
  if (!begin_move(left || right)) return false;
  const int16_t shares[] = {share_of(left), share_of(right)};
  for (uint8_t i = 0; i < SIDES; i++) {
    if (controlled) {
      wheels[i].set_speed(shares[i]);
    } else {
      wheels[i].set_duty(shares[i]);
    }
  }
  return true;
}

bool move_position(uint8_t motor, int16_t speed, int16_t position) {
  if (!is_side(motor) || !begin_move(true)) return false;
  const uint8_t side = side_of(motor);
  wheels[side].go_to(counters[side].travel_at(position, travel_of(side)), share_of(speed));
  return true;
}

bool move_omni(uint8_t, int16_t, int16_t) { return false; }

bool calibrate() { return false; }

bool set_prescaler(uint8_t encoder, uint8_t value) {
  if (!is_side(encoder)) return false;
  counters[side_of(encoder)].set_prescaler(value, travel_of(side_of(encoder)));
  return true;
}

bool preset_encoder(uint8_t encoder, int16_t count) {
  if (!is_side(encoder)) return false;
  counters[side_of(encoder)].preset(count, travel_of(side_of(encoder)));
  return true;
}

bool reset_encoders() { return preset_encoder(LEFT_MOTOR, 0) && preset_encoder(RIGHT_MOTOR, 0); }

void stop(StopReason reason) {
  status::stopped(reason);
  if (reason == StopReason::host) refused = false;
  for (uint8_t i = 0; i < SIDES; i++) {
    wheels[i].stop();
    write(i);
  }
}

// The counts are read at this moment.
void want_counts() {
  hal::encoder_read(live);
  frame_counts.left = counters[LEFT].read(wheels[LEFT].travel() + moved_by(LEFT, live));
  frame_counts.right = counters[RIGHT].read(wheels[RIGHT].travel() + moved_by(RIGHT, live));
  frame_counts.tick = live.tick;
}

CountsState counts_state() { return CountsState::ready; }

const Counts& counts() { return frame_counts; }

int16_t capabilities() {
  return CAPABILITY_BRIDGE | CAPABILITY_NO_TEMPERATURE | (battery::connected() ? 0 : CAPABILITY_NO_BATTERY);
}

// Temperature and version of a motor board are not there; the battery is 0 if it is not measured.
void report_info() {
  writer::add(0);
  writer::add(0);
  writer::add(battery::centivolts());
  writer::add(PROTOCOL_VERSION);
  writer::add(config::get(Parameter::robot_id));
}

// The sum stops at the largest number of a field.
void report_status() {
  const uint16_t impossible = hal::impossible_transitions();
  writer::add(impossible < INT16_MAX ? static_cast<int16_t>(impossible) : INT16_MAX);
}

// ---- nothing on the bus

bool has_work() { return false; }
bool next_transfer(hal::Transfer&) { return false; }
bool next_poll(hal::Transfer&, bool) { return false; }
void transfer_ended(bus::Result) {}

}  // namespace motor
}  // namespace mrl

#endif
