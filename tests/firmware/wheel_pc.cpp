// The parts of the firmware's control of a wheel on their own, each with one state, in builds with an H-bridge.
#include "build.h"

#if MRL_BRIDGE

#include "src/motors/bridge.h"
#include "src/board/config.h"
#include "src/motors/encoder_counter.h"
#include "hal_pc.h"
#include "src/motors/speed_estimate.h"
#include "src/motors/wheel.h"
#include "src/motors/wheel_settings.h"
#include "src/motors/wheel_watch.h"

namespace {

mrl::WheelSettings settings;
mrl::Wheel wheel;
mrl::WheelWatch watch;
mrl::SpeedEstimate estimate;
mrl::EncoderCounter counter;

}  // namespace

int pc_settings(const int16_t* parameters, uint32_t* out) {
  for (uint8_t i = 0; i < mrl::PARAMETER_COUNT + mrl::PIN_COUNT; i++) mrl::config::set(static_cast<mrl::Parameter>(i), parameters[i]);
  if (!settings.configure()) return 0;
  const uint32_t all[] = {
      settings.full_counts_q8,      settings.share_per_count_tick,          settings.share_per_count_q8, settings.share_per_mm_s_q8,
      settings.share_per_mrad_s_q12, static_cast<uint32_t>(settings.ramp_q8),                       settings.kp_q10,             settings.target_gain_q10,
      settings.ki_q16,              static_cast<uint32_t>(settings.friction), settings.pause_periods};
  for (uint32_t each : all) *out++ = each;
  return 1;
}

void pc_wheel_parts_start() {
  wheel = mrl::Wheel();
  watch = mrl::WheelWatch();
  estimate = mrl::SpeedEstimate();
  counter = mrl::EncoderCounter();
}

void pc_wheel_set_speed(int speed) { wheel.set_speed(static_cast<int16_t>(speed)); }
void pc_wheel_set_duty(int duty) { wheel.set_duty(static_cast<int16_t>(duty)); }
void pc_wheel_go_to(int32_t travel, int speed) { wheel.go_to(travel, static_cast<int16_t>(speed)); }
void pc_wheel_stop() { wheel.stop(); }
void pc_wheel_control() { wheel.control(settings); }
int pc_wheel_update(int moved, int edge_tick, int tick) {
  const auto reason = wheel.measure(settings, static_cast<int16_t>(moved), static_cast<uint16_t>(edge_tick), static_cast<uint16_t>(tick));
  wheel.ramp(settings);
  wheel.control(settings);
  return static_cast<int>(reason);
}
int pc_wheel_level() { return wheel.level() * wheel.last_direction(); }
int pc_wheel_last_direction() { return wheel.last_direction(); }
int32_t pc_wheel_travel() { return wheel.travel(); }

int pc_watch_update(int direction, int duty, int moved, int edges, int speed, int controlled) {
  return static_cast<int>(watch.update(settings, static_cast<int8_t>(direction), static_cast<int16_t>(duty),
                                       static_cast<int16_t>(moved), edges, static_cast<int16_t>(speed), controlled));
}

int pc_estimate_update(int count, int edge_tick, int tick) {
  estimate.update(settings, static_cast<uint16_t>(count), static_cast<uint16_t>(edge_tick), static_cast<uint16_t>(tick));
  return estimate.speed();
}

int pc_counter_read(int32_t travel) { return counter.read(travel); }
void pc_counter_preset(int count, int32_t travel) { counter.preset(static_cast<int16_t>(count), travel); }
void pc_counter_prescale(int power, int32_t travel) { counter.set_prescaler(static_cast<uint8_t>(power), travel); }
int32_t pc_counter_travel_at(int count, int32_t travel) { return counter.travel_at(static_cast<int16_t>(count), travel); }

int pc_bridge_levels(int chip, int backward, int duty, int coast) {
  const mrl::bridge::Levels pins = mrl::bridge::levels(static_cast<mrl::Bridge>(chip), backward, static_cast<uint8_t>(duty), coast);
  return pins.pwm_a << 16 | pins.pwm_b << 8 | pins.logic;
}
int pc_bridge_rate(int chip) { return static_cast<int>(mrl::bridge::rate(static_cast<mrl::Bridge>(chip))); }

#endif
