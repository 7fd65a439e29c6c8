// The hardware interface of the firmware.  The hal_*.cpp files implement it on the Uno; the tests have one for the PC.
#pragma once
#include <stdint.h>

#include "../../build.h"

namespace hal {

// Sets up the peripherals; afterwards interrupts are enabled.
void begin();

// ---- time

// Free-running counter of 64 us; wraps every 4.194 s.
uint16_t ticks();

// ---- sleep

// True if an interrupt has had news for the loop since the last call: room in a queue, a byte of the radio, the end of a
// transfer, a conversion or an EEPROM write, the time of sleep_until().
bool take_news();
// Sleeps until there is news or a byte from the host, or ticks() is `tick`, which may have passed already; at most 2 s
// ahead.
void sleep_until(uint16_t tick);

// ---- serial port to the host, 8N1, interrupt-driven in both directions

constexpr uint8_t SERIAL_OUT_SIZE = 64;
// It is news when this many bytes are waiting to be sent, or a multiple of eight more, or none.
constexpr uint8_t SERIAL_OUT_NEWS = 7;
constexpr uint8_t SERIAL_DIVIDER = 16;  // at first; the speed is 16 MHz / (8 (divider + 1))

// The next received byte, or -1.
int16_t serial_read();
// True if serial_read() has a byte.
bool serial_received();
// Drops all received bytes.
void serial_discard();
// Number of bytes lost since the last call; at most 255.
uint8_t serial_overruns();
// Number of bytes that serial_write() accepts now.
uint8_t serial_room();
// Number of bytes that have not reached the transmitter yet.
uint8_t serial_waiting();
// Changes the baud rate in both directions; no byte may be waiting to be sent.
void serial_speed(uint8_t divider);
// Queues one byte; there must be room.
void serial_write(uint8_t byte);

// ---- I2C master, interrupt-driven: one transfer at a time

// Writes `out`, then, if `in_count` is not 0, reads `in`.
struct Transfer {
  uint8_t address;  // 7 bits
  uint8_t out_count;
  uint8_t out[9];
  uint8_t in_count;
  uint8_t in[10];
  uint8_t divider;    // SCL is 16 MHz / (16 + 2 divider)
  bool stop_between;  // stop and start instead of a repeated start before the read
};

enum class BusState : uint8_t {
  idle,
  busy,
  nack,  // no device there, or a byte was not acknowledged
  lost,  // another master or a fault holds the bus
};

// Belongs to the caller unless the bus is busy.
extern Transfer transfer;
// Starts `transfer`.  The state is `busy` until it has ended, then `idle` if all went well.
void bus_start();
BusState bus_state();
// ticks() at the moment the slave of the last read acknowledged its address.
uint16_t bus_latched();
// Ends any transfer, and clocks until a slave releases SDA; takes 120 us.
void bus_recover();

// ---- analog inputs: one conversion at a time, 104 us

void adc_start(uint8_t channel);
// The result, or -1 while the conversion runs.
int16_t adc_result();

// ---- pins

void pin_output(uint8_t pin, bool level);
// Input without a pull-up; this and the following only in builds with MRL_BRIDGE.
void pin_release(uint8_t pin);
// Input with a pull-up.
void pin_pull_up(uint8_t pin);
bool pin_level(uint8_t pin);

// ---- EEPROM

constexpr uint16_t EEPROM_SIZE = 1024;

// False while a byte is being written (3.4 ms); the other two calls need true.
bool eeprom_ready();
uint8_t eeprom_read(uint16_t address);
void eeprom_write(uint16_t address, uint8_t value);

// ---- resets

// The cause of the last reset, from the chip's flags and the marks in RAM that survive a reset; valid after begin().
struct ResetTrace {
  bool power_on, external, brown_out, watchdog;  // the chip's flags, all false behind a bootloader that clears them
  bool watchdog_marked;                          // the watchdog's interrupt left its mark
  bool memory_kept;                              // RAM still holds what the last run wrote
};
ResetTrace reset_trace();
// Resets the board 384 ms after the last call.
void watchdog_kick();

// ---- XBee: a second serial port, 9600 baud 8N1, interrupt-driven in both directions; only in builds with MRL_XBEE

constexpr uint8_t RADIO_OUT_SIZE = 64;

void radio_begin();
// The next received byte, or -1.
int16_t radio_read();
// Number of bytes that radio_write() accepts now.
uint8_t radio_room();
// Queues one byte; there must be room.
void radio_write(uint8_t byte);

// ---- dust sensor: low pulses on ICP1

// Time for which the input was low since the last call [64 us].
uint32_t dust_low_ticks();
// True if the input has changed at all since the last call.
bool dust_changed();

// ---- H-bridge and encoders; only in builds with MRL_BRIDGE, whose pins are known when the board runs

constexpr uint8_t MOTORS = MRL_MEGA ? 4 : 2;  // each has an encoder; in front left, right, then behind them
enum class BridgePin : uint8_t { pwm_a, pwm_b, logic, enable };
constexpr uint8_t BRIDGE_WIRES = 3, BRIDGE_PINS = 4, CHANNELS = 2;  // the enable may be that of several motors
constexpr uint8_t SERVOS = MRL_MEGA ? 6 : 2;

// Arduino pins by motor; NOT_CONNECTED is none.
struct Wires {
  int8_t bridge[MOTORS][BRIDGE_PINS];
  int8_t encoder[MOTORS][CHANNELS];  // channels A and B
  int8_t servo[SERVOS];
  bool ranges;                       // whether echoes must be timed
};

// PWM of 3.9, 7.8 and 31.4 kHz.
enum class PwmRate : uint8_t { slow, medium, fast };
// Makes outputs of the pins of the bridges, all low, and counts the encoders, whose lines get pull-ups.  `pwm` has a bit
// for each BridgePin that carries PWM; a timer must drive it, and one timer must be left for the clock.  A servo needs an
// output of a 16-bit timer that makes no PWM.  If ranges need a timer with PWM, all PWM is medium.
void bridge_begin(const Wires& wires, PwmRate rate, uint8_t pwm);
// Switches all outputs off, and makes inputs without pull-ups of all pins that bridge_begin() has taken.
void bridge_end();

// Holds the outputs of a motor high for `duty` / 255 of the time, by BridgePin, the last one first; 0 and 255 are
// constant.  Any duty but 0 is high on a pin without PWM.  Does nothing while a kick of the watchdog is missing, or without
// bridge_begin().
void bridge_write(uint8_t motor, const uint8_t (&duties)[BRIDGE_PINS]);
// All outputs are low at once; from any context.  The watchdog's interrupt does this at the first missed kick.
void bridge_off();

constexpr uint16_t SAMPLE_TICKS = 78;  // 4.992 ms: 200.3 Hz
// More edges between two samples mask the interrupt of an encoder, or of all encoders on a port: 50 000 edges/s.
constexpr uint8_t MOST_EDGES = 250;

struct EncoderSample {
  uint16_t count[MOTORS];      // forward, A before B, counts up; wraps
  uint16_t edge_tick[MOTORS];  // ticks() at the last edge before the last sample
  uint16_t tick;               // ticks() at the sample
};
// Takes the newest sample; true if it is a new one.  A sample is news for the loop.
bool encoder_sample(EncoderSample& sample);
// The counters as they are now; returns their tick.
uint16_t encoder_read(uint16_t (&counts)[MOTORS]);
// Number of steps that changed both channels of an encoder at once, all encoders; stops at 65535.
uint16_t impossible_transitions();
// True after more than MOST_EDGES edges between two samples, which is news for the loop, until encoder_unmask().
bool encoder_masked(uint8_t encoder);
void encoder_unmask(uint8_t encoder);
// Counts the edges of channel A alone, each one up.  An encoder whose channel B is not connected is counted so anyway.
void encoder_single_channel(bool on);

// Gives a servo pulses of this length [us] every 20 ms, from the next one on.  With 0 they end, if none is being sent: the
// call must be repeated.
void servo_write(uint8_t servo, uint16_t pulse);

// ---- echoes of HC-SR04, one at a time; only in builds with MRL_BRIDGE

constexpr uint8_t RANGES = MRL_MEGA ? 6 : 3;  // whose pins are parameters

enum class Echo : uint8_t { none, high, over };  // it has not begun; it has, and is still high; it has ended
// Pulses a trigger for 10 us, and waits for its echo instead of the one before; false, without a pulse, if the echo is
// high already.
bool range_fire(uint8_t trigger, uint8_t echo);
constexpr uint16_t LONG_ECHO = 0xFFFF;
// The state of the echo, and its length if it is over [0.5 us]: LONG_ECHO from 30 ms on.  Its end is news for the loop.
Echo range_echo(uint16_t& length);

// The I2C bus takes its pins, or leaves them as inputs without pull-ups; other builds begin it at the start.
void bus_use(bool on);

}  // namespace hal
