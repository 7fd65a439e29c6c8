// One wheel: its command, its ramp, the control of its speed, and its supervision.  Pure: counts in, duty out.
#pragma once
#include <stdint.h>

#include "../serial/protocol.h"
#include "speed_estimate.h"
#include "wheel_settings.h"
#include "wheel_watch.h"

namespace mrl {

class Wheel {
 public:
  // ---- commands: signed shares

  void set_speed(int16_t speed) { set(Mode::speed, speed); }
  // Without control of the speed.
  void set_duty(int16_t duty) { set(Mode::duty, duty); }
  // Turns to a travel at this speed at most, and comes back when it is pushed away.
  void go_to(int32_t travel, int16_t speed);
  // Switches the output off at once, without a ramp.
  void stop();

  // ---- one period

  // The counter and its last edge at the end of the period; returns why the motors must stop, or `none`.
  StopReason measure(const WheelSettings& settings, int16_t moved, uint16_t edge_tick, uint16_t tick);
  // Moves the setpoint towards the command.
  void ramp(const WheelSettings& settings);
  // Computes the duty from setpoint and measurement; a stop since the ramp leaves it at 0.
  void control(const WheelSettings& settings);
  // Whether it is driven forward, or backward, or will be; a move to a travel may do both.
  bool turns(bool backward) const;
  // The direction in which single-channel encoders count: that of the last drive.
  int8_t last_direction() const { return backward_ ? -1 : 1; }

  // ---- what comes out

  // The output for the next period, of 255, in the last direction; its mean over the periods is the duty.
  uint8_t level();
  // The sum of all counts.
  int32_t travel() const { return travel_; }

 private:
  enum class Mode : uint8_t { speed, duty, position };

  void set(Mode mode, int16_t target);
  int16_t approach(const WheelSettings& settings) const;
  void come_to_rest(const WheelSettings& settings);

  Mode mode_{};         // speed
  int16_t target_ = 0;   // of a positional move: the highest speed
  int32_t go_to_ = 0;    // [count]
  int32_t travel_ = 0;   // [count]
  int32_t setpoint_q8_ = 0;   // magnitude
  int8_t direction_ = 0;      // of the drive: -1, 0 at rest, 1
  bool backward_ = false;  // the last drive
  uint8_t pause_ = 0;  // periods before the drive may be reversed
  bool driven_ = false;  // the pause of this rest has not begun
  int32_t integral_q16_ = 0;
  int16_t duty_ = 0;  // in the drive's direction
  uint16_t carry_ = 0;
  uint16_t edge_tick_ = 0;
  SpeedEstimate estimate_;
  WheelWatch watch_;
};

}  // namespace mrl
