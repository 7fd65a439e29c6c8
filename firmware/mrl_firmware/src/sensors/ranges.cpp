#include "../../build.h"

#if MRL_BRIDGE

#include "ranges.h"

#include "../board/board_clock.h"
#include "../board/config.h"
#include "../board/status.h"
#include "../board/wiring.h"
#include "../hal/chip.h"
#include "../hal/hal.h"
#include "../serial/frame_writer.h"
#include "../serial/protocol.h"
#include "battery.h"
#include "sonar.h"

namespace mrl {
namespace ranges {
namespace {

constexpr uint32_t TURN = board_clock::of_ms(60) + 1;
constexpr uint32_t SAMPLE_PERIOD = board_clock::of_ms(40);  // a GP2Y0A21 measures as often
constexpr uint8_t HELD_FOR = 5;  // turns of all; modules end an echo after 38 ms, some after 200 ms
constexpr uint16_t FARTHEST = 4000;  // mm, by the data sheet

struct Pins {
  uint8_t trigger, echo;
};
Pins pins[hal::RANGES];
int16_t values[hal::RANGES];
uint8_t fired_before[hal::RANGES];  // turns of all, at most HELD_FOR
uint8_t with_trigger, analog;   // a bit each
uint8_t turn;
bool awaiting;  // an echo, or its end
uint32_t since, sampled_at;
uint8_t converted = hal::RANGES;  // the one whose voltage is being converted, or none

bool has(uint8_t bits, uint8_t range) { return bits >> range & 1; }

// Half the way of the sound at 331.3 + 0.606 T m/s; in half a microsecond it is 2^-19 mm times this.  A division would take
// time from a stop.
int16_t millimetres(uint16_t half_us) {
  if (half_us == hal::LONG_ECHO) return RANGE_NOTHING;
  const uint16_t way = static_cast<uint16_t>(43424 + (1271L * config::get(Parameter::air_temperature) >> 4));
  const uint16_t range = static_cast<uint16_t>((static_cast<uint32_t>(half_us) * way + (1UL << 18)) >> 19);
  return range > FARTHEST ? RANGE_NOTHING : static_cast<int16_t>(range);
}

void report_fault() {
  bool held = false;
  for (const int16_t value : values) held = held || value == RANGE_HELD;
  status::set_fault(FAULT_SENSOR, held);
}

void take_echo() {
  uint16_t length;
  if (hal::range_echo(length) != hal::Echo::over) return;
  values[turn] = millimetres(length);
  awaiting = false;
}

void end_turn() {
  uint16_t length;
  if (awaiting) values[turn] = hal::range_echo(length) == hal::Echo::high ? RANGE_NOTHING : RANGE_INVALID;
}

void begin_turn() {
  do {
    turn = static_cast<uint8_t>(turn + 1 < hal::RANGES ? turn + 1 : 0);
  } while (!has(with_trigger, turn));
  since = board_clock::now();
  awaiting = hal::range_fire(pins[turn].trigger, pins[turn].echo);
  for (uint8_t& before : fired_before) before = static_cast<uint8_t>(before + (before < HELD_FOR));
  if (awaiting) fired_before[turn] = 0;
  else if (fired_before[turn] == HELD_FOR) values[turn] = RANGE_HELD;
}

// Small rather than fast: the loop's other tasks are compiled for speed, and would make it part of them.  A board
// without sensors does not even save the registers that it needs.
__attribute__((noinline)) void measure() {
  if (awaiting) take_echo();
  if (!board_clock::passed(since, TURN)) return;
  end_turn();
  begin_turn();
  report_fault();
}

// Converts the next analog one from this one on, if there is one.
void convert(uint8_t range) {
  while (range < hal::RANGES && !has(analog, range)) range++;
  converted = range;
  if (converting()) hal::adc_start(chip::channel(pins[range].echo));
}

__attribute__((noinline)) void sample() {
  if (converting()) {
    const int16_t count = hal::adc_result();
    if (count < 0) return;
    values[converted] = count;
    convert(static_cast<uint8_t>(converted + 1));
  } else if (board_clock::passed(sampled_at, SAMPLE_PERIOD) && !battery::converting() && !sonar::converting()) {
    sampled_at = board_clock::now();
    convert(0);
  }
}

void take_pins(uint8_t range) {
  const int8_t trigger = wiring::range_pin(range, false), echo = wiring::range_pin(range, true);
  pins[range] = {static_cast<uint8_t>(trigger), static_cast<uint8_t>(echo)};
  if (echo == NOT_CONNECTED) return;
  uint8_t& bits = trigger == NOT_CONNECTED ? analog : with_trigger;
  bits = static_cast<uint8_t>(bits | 1 << range);
  if (trigger != NOT_CONNECTED) hal::pin_output(pins[range].trigger, false);
}

}  // namespace

uint8_t timed() { return with_trigger; }

uint8_t connected() { return with_trigger | analog; }

bool converting() { return converted < hal::RANGES; }

void begin() {
  since = sampled_at = board_clock::now();
  awaiting = false;
  for (uint8_t i = 0; i < hal::RANGES; i++) {
    fired_before[i] = 0;
    take_pins(i);
  }
}

void end() {
  for (uint8_t i = 0; i < hal::RANGES; i++) {
    if (has(with_trigger, i)) hal::pin_release(pins[i].trigger);
    values[i] = RANGE_INVALID;
  }
  with_trigger = analog = 0;
  converted = hal::RANGES;
  report_fault();
}

void service() {
  if (with_trigger) measure();
  if (analog) sample();
}

void report() {
  for (uint8_t i = 0; i < RANGES_IN_REPLY; i++) writer::add(i < hal::RANGES ? values[i] : RANGE_INVALID);
}

}  // namespace ranges
}  // namespace mrl

#endif
