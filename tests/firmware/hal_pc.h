// The firmware on a PC: hardware as an extern "C" interface, time as a number that the caller moves.
// One board per loaded library: all state is static, as on the chip.
#pragma once
#include <stdint.h>

extern "C" {

// Called for everything that happens outside the board; `time_us` is the board's time.
struct PcWorld {
  int (*i2c_write)(uint8_t address, const uint8_t* data, int count, double time_us);  // 0: not acknowledged
  int (*i2c_read)(uint8_t address, uint8_t* data, int count, double time_us);         // 0: not acknowledged
  int (*adc)(int channel, double time_us);                                            // count, 0 to 1023
  void (*pin)(int pin, int level, double time_us);
  // Builds with an H-bridge: all outputs of a motor [0 to 255], and the level of an encoder's line at the start.
  void (*bridge)(int motor, int pwm_a, int pwm_b, int logic, int enable, double time_us);
  int (*level)(int pin);
  void (*release)(int pin, double time_us);  // the pin becomes an input
  // When the last echo on a pin begins and ends [us], perhaps in the future; both 0 if there is none.
  void (*echo)(int pin, double* begin_us, double* end_us);
};

enum PcResetFlag { PC_POWER_ON = 1, PC_EXTERNAL = 2, PC_BROWN_OUT = 4, PC_WATCHDOG = 8, PC_MARKED = 16, PC_KEPT = 32 };

// Starts the board at a time, with a 16-bit tick counter that begins at `first_tick`.
void pc_start(const PcWorld* world, double time_us, uint16_t first_tick, int reset_flags, const uint8_t* eeprom);
// Runs the loop until a time.
double pc_advance(double time_us);
// Lets time pass while the loop stands still.
void pc_stall(double time_us);
double pc_now_us();
// Puts a byte on the line to the board, behind those still on it.
void pc_receive(uint8_t byte);
// Speed of the host's end, 115200 at first.
void pc_set_host_baud(double baud);
// Takes bytes that have left the board; returns how many.
int pc_sent(uint8_t* bytes, int room);
// Holds the bus: transfers never end until it is released by hand, or after so many recoveries (0: never).
void pc_hang_bus(int on, int recoveries);
void pc_dust(uint32_t low_ticks);
// An edge of an encoder's line; edges come in the order of their times.
void pc_edge(int pin, int level, double time_us);
// A byte from the radio, and bytes to it.
void pc_radio_receive(uint8_t byte);
int pc_radio_sent(uint8_t* bytes, int room);
const uint8_t* pc_eeprom();
// EEPROM cells that take no more bytes.
void pc_break_eeprom(int on);
// Number of passes in which the loop did something although it had asked to sleep until later.
int pc_slept_too_long();
// Longest time between two kicks of the hardware watchdog so far.
double pc_longest_kick_gap_us();

// ---- parts on their own

void pc_decoder_start(int checked, int asked, int plain_calibrate);
// 0 nothing, 1 frame, 2 garbage.
int pc_decoder_feed(uint8_t byte);
int pc_decoder_code();
int pc_decoder_count();
const int16_t* pc_decoder_arguments();
int pc_decoder_reason();
int pc_decoder_length();
int pc_power_law(int count, int a, int b, int c);
int pc_range_cm(int count);
int pc_dust_per_litre(uint32_t low, uint32_t total);

// ---- control of a wheel, in builds with an H-bridge: settings, a wheel, a watch, an estimate and a counter of their own

// Puts these parameters in force; 0 if they cannot be controlled, otherwise `out` has the settings in their order.
int pc_settings(const int16_t* parameters, uint32_t* out);
// All but the settings begin anew.
void pc_wheel_parts_start();
void pc_wheel_set_speed(int speed);
void pc_wheel_set_duty(int duty);
void pc_wheel_go_to(int32_t travel, int speed);
void pc_wheel_stop();
void pc_wheel_control();
// The reason to stop.
int pc_wheel_update(int moved, int edge_tick, int tick);
int pc_wheel_level();
int pc_wheel_last_direction();
int32_t pc_wheel_travel();
int pc_watch_update(int direction, int duty, int moved, int edges, int speed, int controlled);
// The speed.
int pc_estimate_update(int count, int edge_tick, int tick);
int pc_counter_read(int32_t travel);
void pc_counter_preset(int count, int32_t travel);
void pc_counter_prescale(int power, int32_t travel);
int32_t pc_counter_travel_at(int count, int32_t travel);
// The levels of PWM A, PWM B and the logic pin, one byte each.
int pc_bridge_levels(int chip, int backward, int duty, int coast);
int pc_bridge_rate(int chip);
void pc_virtual_steps(int samples, int left, int right, uint16_t* counts);
// The first problem of a wiring: values of its parameters in, and problem, parameter and other out.
int pc_wiring_check(const int8_t* pins, int bridge, int8_t* out);
}
