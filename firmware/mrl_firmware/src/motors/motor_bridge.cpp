// Motors on H-bridges and encoders, all on the Arduino's pins, two or four of each: turns requests into commands to the wheels,
// and measures or drives one wheel in each pass of the loop.
#include "../hal/fast.h"
#include "../../build.h"

#if MRL_BRIDGE

#include "../sensors/battery.h"
#include "../board/board_clock.h"
#include "bridge.h"
#include "../board/config.h"
#include "encoder_counter.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../sensors/inputs.h"
#include "motor.h"
#include "../board/status.h"
#include "../serial/stream.h"
#include "wheel.h"
#include "wheel_settings.h"
#include "../board/wiring.h"
#include "../virtual/virtual_robot.h"

namespace mrl {
namespace motor {
namespace {

// The rear wheels of four come behind these, in the same order: an odd wheel is a right one.
enum Side : uint8_t { LEFT, RIGHT, SIDES };
constexpr uint8_t LEFT_MOTOR = 1, RIGHT_MOTOR = 3;  // their numbers in the protocol

constexpr uint8_t PASS = 3;  // of the loop, at most [tick]
constexpr uint32_t REFUSED_FOR = board_clock::of_ms(1000);  // after the chip has stopped a wheel

WheelSettings settings;
Wheel wheels[hal::MOTORS];
uint8_t count = SIDES;  // of wheels that are wired
EncoderCounter counters[SIDES];
hal::EncoderSample sample;
int32_t travels[hal::MOTORS];  // at the last read_travels()
uint16_t last_counts[hal::MOTORS];
uint8_t to_serve;  // steps that are left for this sample: a measurement of each wheel, their ramps, a control of each
bool single[hal::MOTORS];  // the encoder has channel A alone
Counts frame_counts;
int16_t wheel_counts[hal::MOTORS];
uint32_t refused_since;
bool usable;   // bridge, wiring and numbers are set
bool refused;  // moves, since the chip has stopped a wheel
bool undervoltage;
bool looked;  // at the inputs, in the last pass

// ---- wires: the motor that drives a wheel, and the encoder that it turns

bool is_front(uint8_t wheel) { return hal::MOTORS == SIDES || wheel < SIDES; }

uint8_t motor_of(uint8_t wheel) { return is_front(wheel) && wiring::has(WIRING_MOTORS_SWAPPED) ? wheel ^ 1 : wheel; }

uint8_t encoder_of(uint8_t wheel) {
  return is_front(wheel) && wiring::has(WIRING_ENCODERS_SWAPPED) ? wheel ^ 1 : wheel;
}

// One flag a wheel, that of a right one behind that of a left one.
bool is_reversed(uint8_t wheel, int16_t front, int16_t rear) {
  return wiring::has(static_cast<int16_t>((is_front(wheel) ? front : rear) << (wheel & 1)));
}

bool motor_reversed(uint8_t wheel) {
  return is_reversed(wheel, WIRING_LEFT_MOTOR_REVERSED, WIRING_REAR_LEFT_MOTOR_REVERSED);
}

bool encoder_reversed(uint8_t wheel) {
  return is_reversed(wheel, WIRING_LEFT_ENCODER_REVERSED, WIRING_REAR_LEFT_ENCODER_REVERSED);
}

// A single channel counts up; its direction is that of the command.
int16_t oriented(uint8_t wheel, int16_t counts) {
  const bool back = single[wheel] ? wheels[wheel].last_direction() < 0 : encoder_reversed(wheel);
  return static_cast<int16_t>(back ? -counts : counts);
}

// All pins each time: after a missed kick of the chip's watchdog they are low.
void write(uint8_t wheel) {
  const uint8_t duty = wheels[wheel].level();
  const bool backward = (wheels[wheel].last_direction() < 0) != motor_reversed(wheel);
  const bridge::Levels pins =
      bridge::levels(usable ? wiring::bridge() : Bridge::unset, backward, duty, config::get(Parameter::stop_mode));
  hal::bridge_write(motor_of(wheel), {pins.pwm_a, pins.pwm_b, pins.logic, static_cast<uint8_t>(usable ? 255 : 0)});
}

// ---- stops

__attribute__((noinline)) void stop_for(StopReason reason) {
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

// Stops if a wheel turns to a side where an input is active.
bool stopped_by_input() {
  for (uint8_t backward = 0; backward < 2; backward++) {
    const StopReason reason = inputs::against(backward);
    for (uint8_t i = 0; i < count && reason != StopReason::none; i++) {
      if (!wheels[i].turns(backward)) continue;
      stop(reason);
      return true;
    }
  }
  return false;
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
  for (uint8_t i = 0; i < count; i++) {
    if (hal::encoder_masked(i)) hal::encoder_unmask(i);
  }
  status::turned();
  return true;
}

// ---- periods

__attribute__((noinline)) int16_t moved_by(uint8_t wheel, const uint16_t (&now)[hal::MOTORS]) {
  const uint8_t encoder = encoder_of(wheel);
  const int16_t counts = static_cast<int16_t>(now[encoder] - last_counts[encoder]);
  return oriented(wheel, counts);
}

void measure(uint8_t wheel) {
  const uint8_t encoder = encoder_of(wheel);
  const int16_t moved = moved_by(wheel, sample.count);
  last_counts[encoder] = sample.count[encoder];
  const StopReason reason = wheels[wheel].measure(settings, moved, sample.edge_tick[encoder], sample.tick);
  if (reason != StopReason::none) stop_for(reason);
}

// One step.  All ramps are in one: a command between those of two wheels would turn the robot.
void serve(uint8_t left) {
  if (left > count + 1) return measure(static_cast<uint8_t>(2 * count + 1 - left));
  if (left == count + 1) {
    for (uint8_t i = 0; i < count; i++) wheels[i].ramp(settings);
    return;
  }
  const uint8_t wheel = static_cast<uint8_t>(count - left);
  wheels[wheel].control(settings);
  write(wheel);
}

// A frame that is due within a pass keeps its cadence.  One that is due already waits for the serial link, perhaps for long.
bool frame_goes_first() { return streams::main.due_within(PASS) && !streams::main.due(); }

// ---- moves

// Of -100 to 100: the table has no other percentages.
__attribute__((noinline)) int16_t share_of(int16_t percent) {
  return static_cast<int16_t>(static_cast<int32_t>(percent) * 10486 / 64);  // * FULL / 100
}

// If a wheel would be faster than it can be, all slow down by the same factor, which keeps the arc.
void set_speeds(const int32_t (&shares)[hal::MOTORS]) {
  int32_t most = 0;
  for (const int32_t share : shares) {
    const int32_t size = share < 0 ? -share : share;
    if (size > most) most = size;
  }
  const int32_t factor_q14 = most > FULL ? (static_cast<int32_t>(FULL) << 14) / most : 0;
  for (uint8_t i = 0; i < hal::MOTORS; i++) {
    const int32_t share = factor_q14 ? shares[i] / 16 * factor_q14 / 1024 : shares[i];
    wheels[i].set_speed(static_cast<int16_t>(share));
  }
}

bool take_settings() {
  return wiring::accepted() && wiring::has(WIRING_SET) && settings.configure();
}

void take_channels() {
  count = wiring::motors() > SIDES ? hal::MOTORS : uint8_t{SIDES};
  to_serve = 0;
  hal::encoder_single_channel(wiring::has(WIRING_SINGLE_CHANNEL));
  for (uint8_t wheel = LEFT; wheel < count; wheel++) {
    single[wheel] = wiring::is_single(encoder_of(wheel));
  }
}

// The counters at this moment, beyond the last sample; returns their tick.
__attribute__((noinline)) uint16_t read_travels() {
  uint16_t now[hal::MOTORS];
  const uint16_t tick = hal::encoder_read(now);
  for (uint8_t i = 0; i < count; i++) travels[i] = wheels[i].travel() + moved_by(i, now);
  return tick;
}

// The mean of the wheels on a side.
int32_t side_travel(uint8_t side) {
  const int32_t front = travels[side];
  if (hal::MOTORS == SIDES || count == SIDES) return front;
  const uint32_t ahead = static_cast<uint32_t>(travels[side + SIDES]) - static_cast<uint32_t>(front);
  return static_cast<int32_t>(static_cast<uint32_t>(front) + static_cast<uint32_t>(static_cast<int32_t>(ahead) >> 1));
}

__attribute__((noinline)) int32_t travel_now(uint8_t side) {
  read_travels();
  return side_travel(side);
}

bool is_side(uint8_t motor) { return motor == LEFT_MOTOR || motor == RIGHT_MOTOR; }

uint8_t side_of(uint8_t motor) { return motor == LEFT_MOTOR ? LEFT : RIGHT; }

}  // namespace

void begin() { refresh_all(); }

// A stop may come between the measurement of a wheel and its control.  A line that oscillates may have cost the chip the
// host's stop, so this does not wait for the next sample.
void service() {
  for (uint8_t i = 0; i < count && status::turning(); i++) {
    if (hal::encoder_masked(i)) stop_for(StopReason::encoder);
  }
  const bool before = looked;
  looked = inputs::service();
  if (looked && status::turning()) stopped_by_input();
  if (looked && !before) return;  // a host's stop does not wait for a wheel as well; passes of 1 ms look each time
  if (to_serve && !frame_goes_first()) serve(to_serve--);
  if (!to_serve) {  // the news of a sample may be gone by the end of the service of the one before
    if (!hal::encoder_sample(sample)) return;
    to_serve = static_cast<uint8_t>(2 * count + 1);
    watch_battery();
  }
  board_clock::stay_awake();  // a stop passes before the next wheel is served
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
  if (MRL_VIRTUAL && usable) virtual_robot::configure();
  if (!usable) stop(StopReason::host);
  status::set_fault(FAULT_WIRING, !usable);
}

void refresh_all() { refresh(Parameter::bridge); }

// A mecanum wheel at the front left or the rear right turns backward to move left, the others forward.
bool move_twist(int16_t forward, int16_t left, int16_t angular) {
  if (left && count == SIDES) return false;
  if (!begin_move(forward || left || angular)) return false;
  const auto share = [](int16_t speed) { return (static_cast<int32_t>(speed) * settings.share_per_mm_s_q8 + 128) >> 8; };
  const int32_t ahead = share(forward), aside = hal::MOTORS == SIDES ? 0 : share(left);
  const int32_t turn = (static_cast<int32_t>(angular) * settings.share_per_mrad_s_q12 + 2048) >> 12;
  int32_t shares[hal::MOTORS];
  for (uint8_t i = 0; i < hal::MOTORS; i++) {
    const bool with_aside = i == 1 || i == 2;
    shares[i] = (i & 1 ? ahead + turn : ahead - turn) + (with_aside ? aside : -aside);
  }
  set_speeds(shares);
  return !stopped_by_input();
}

bool move_percent(int16_t left, int16_t right, bool controlled) {
  if (!begin_move(left || right)) return false;
  const int16_t shares[] = {share_of(left), share_of(right)};
  for (uint8_t i = 0; i < hal::MOTORS; i++) {
    if (controlled) {
      wheels[i].set_speed(shares[i & 1]);
    } else {
      wheels[i].set_duty(shares[i & 1]);
    }
  }
  return !stopped_by_input();
}

#if MRL_MEGA
bool move_wheels(const int16_t* percents) {
  const auto any = [percents] { return percents[0] || percents[1] || percents[2] || percents[3]; };
  if (count == SIDES || !begin_move(any())) return false;
  for (uint8_t i = 0; i < count; i++) wheels[i].set_duty(share_of(percents[i]));
  return !stopped_by_input();
}
#endif

bool move_position(uint8_t motor, int16_t speed, int16_t position) {
  if (!is_side(motor) || !settings.full_counts_q8 || !begin_move(true)) return false;
  const uint8_t side = side_of(motor);
  const int32_t now = travel_now(side), way = static_cast<int32_t>(
      static_cast<uint32_t>(counters[side].travel_at(position, now)) - static_cast<uint32_t>(now));
  for (uint8_t i = side; i < count; i = static_cast<uint8_t>(i + SIDES)) {
    const uint32_t target = static_cast<uint32_t>(travels[i]) + static_cast<uint32_t>(way);
    wheels[i].go_to(static_cast<int32_t>(target), share_of(speed));
  }
  return !stopped_by_input();
}

bool move_omni(uint8_t, int16_t, int16_t) { return false; }

bool calibrate() { return false; }

bool set_prescaler(uint8_t encoder, uint8_t value) {
  if (!is_side(encoder)) return false;
  counters[side_of(encoder)].set_prescaler(value, travel_now(side_of(encoder)));
  return true;
}

__attribute__((noinline)) bool preset_encoder(uint8_t encoder, int16_t value) {
  if (!is_side(encoder)) return false;
  counters[side_of(encoder)].preset(value, travel_now(side_of(encoder)));
  return true;
}

bool reset_encoders() { return preset_encoder(LEFT_MOTOR, 0) && preset_encoder(RIGHT_MOTOR, 0); }

void stop(StopReason reason) {
  status::stopped(reason);
  if (reason == StopReason::host) refused = false;
  for (uint8_t i = 0; i < hal::MOTORS; i++) {
    wheels[i].stop();
    write(i);
  }
}

// The counts are read at this moment.
void want_counts() {
  frame_counts.tick = read_travels();
  frame_counts.left = counters[LEFT].read(side_travel(LEFT));
  frame_counts.right = counters[RIGHT].read(side_travel(RIGHT));
  for (uint8_t i = 0; i < count; i++) wheel_counts[i] = static_cast<int16_t>(travels[i]);
}

CountsState counts_state() { return CountsState::ready; }

const Counts& counts() { return frame_counts; }

void report_wheels() {
  for (uint8_t i = 0; i < 4; i++) writer::add(i < count ? wheel_counts[i] : 0);
}

int16_t capabilities() {
  return (MRL_VIRTUAL ? CAPABILITY_VIRTUAL : 0) | CAPABILITY_BRIDGE | CAPABILITY_WIRING | CAPABILITY_NO_TEMPERATURE |
         (battery::connected() ? 0 : CAPABILITY_NO_BATTERY);
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
