#include "sensors.h"

#include "../board/board_clock.h"
#include "environment.h"
#include "../hal/flash.h"
#include "../serial/frame_writer.h"
#include "../serial/protocol.h"
#include "../board/status.h"

namespace mrl {
namespace sensors {
namespace {

constexpr uint8_t SLOW_DIVIDER = 72;  // 100 kHz
constexpr uint32_t READ_PERIOD = board_clock::of_ms(48);
constexpr uint32_t WANTED_FOR = board_clock::of_ms(2000);
constexpr uint32_t VALID_FOR = board_clock::of_ms(504);

typedef bool Take(const uint8_t* bytes, int16_t* values);
typedef int16_t Value();

// Those on the bus come first.
#define BUS_INDEX(name, ...) name##_index,
#define CODE(name, code, ...) code,
#define FUNCTION(name, code, there, ...) (there) ? name : nullptr,
enum BusIndex : uint8_t { MRL_BUS_SENSORS(BUS_INDEX) BUS_SENSORS };
const uint8_t CODES[] PROGMEM = {MRL_BUS_SENSORS(CODE) MRL_PIN_SENSORS(CODE)};
Take* const TAKES[] PROGMEM = {MRL_BUS_SENSORS(FUNCTION)};
Value* const VALUES_OF_PINS[] PROGMEM = {MRL_PIN_SENSORS(FUNCTION)};
constexpr uint8_t SENSORS = sizeof CODES;

struct Row {
  uint8_t address, from, bytes, values, optional;
};
#define ROW(name, code, there, address, from, bytes, values, optional) {address, from, bytes, values, optional},
const Row ROWS[] PROGMEM = {MRL_BUS_SENSORS(ROW)};

#define FITS(name, code, there, address, from, bytes, values, optional) \
  static_assert((bytes) <= sizeof hal::Transfer::in, #name " has more registers than one transfer can read");
MRL_BUS_SENSORS(FITS)

struct State {
  uint32_t wanted_at, asked_at, answered_at;
  bool wanted, known, answered, failed, seen;
};

#define PLUS_VALUES(name, code, there, address, from, bytes, values, optional) +(values)
State states[BUS_SENSORS];
int16_t all_values[0 MRL_BUS_SENSORS(PLUS_VALUES)];
uint8_t asked;
bool any_wanted;

// SENSORS if the code does not belong to a sensor.
__attribute__((noinline)) uint8_t index_of(uint8_t code) {
  uint8_t i = 0;
  while (i < SENSORS && flash_byte(&CODES[i]) != code) i++;
  return i;
}

__attribute__((noinline)) int16_t* values_of(uint8_t index) {
  int16_t* values = all_values;
  for (uint8_t i = 0; i < index; i++) values += flash_byte(&ROWS[i].values);
  return values;
}

bool due(State& state) {
  if (state.wanted && board_clock::passed(state.wanted_at, WANTED_FOR)) state.wanted = false;
  return state.wanted && board_clock::passed(state.asked_at, READ_PERIOD);
}

void read(hal::Transfer& transfer, uint8_t index) {
  asked = index;
  states[index].asked_at = board_clock::now();
  transfer.address = flash_byte(&ROWS[index].address);
  transfer.divider = SLOW_DIVIDER;
  transfer.out_count = 1;
  transfer.out[0] = flash_byte(&ROWS[index].from);
  transfer.in_count = flash_byte(&ROWS[index].bytes);
}

}  // namespace

bool knows(uint8_t code) { return index_of(code) < SENSORS; }

void want(uint8_t code) {
  const uint8_t index = index_of(code);
  if (index >= BUS_SENSORS) return;
  State& state = states[index];
  if (!state.wanted) {
    state.known = state.answered = state.failed = false;
    state.asked_at = board_clock::now() - READ_PERIOD;
  }
  state.wanted = any_wanted = true;
  state.wanted_at = board_clock::now();
}

rows::Readiness readiness(uint8_t code) {
  const uint8_t index = index_of(code);
  if (index >= BUS_SENSORS) return rows::Readiness::ready;
  const State& state = states[index];
  if (state.answered && !board_clock::passed(state.answered_at, VALID_FOR)) return rows::Readiness::ready;
  return state.known ? rows::Readiness::impossible : rows::Readiness::wait;
}

static bool failing() {
  if (MRL_ENVIRONMENT && environment::silent()) return true;
  if (!any_wanted) return false;
  for (uint8_t i = 0; i < BUS_SENSORS; i++) {
    const State& state = states[i];
    if (state.wanted && state.failed && (state.seen || !flash_byte(&ROWS[i].optional))) return true;
  }
  return false;
}

void service() { status::set_fault(FAULT_SENSOR, failing()); }

void report(uint8_t code) {
  const uint8_t index = index_of(code);
  if (index >= BUS_SENSORS) return writer::add(flash_pointer(&VALUES_OF_PINS[index - BUS_SENSORS])());
  const int16_t* const values = values_of(index);
  for (uint8_t i = 0; i < flash_byte(&ROWS[index].values); i++) writer::add(values[i]);
}

int16_t largest(uint8_t code) {
  const uint8_t index = index_of(code);
  const int16_t* const values = values_of(index);
  int16_t most = values[0];
  for (uint8_t i = 1; i < flash_byte(&ROWS[index].values); i++) most = values[i] > most ? values[i] : most;
  return most;
}

bool next_transfer(hal::Transfer& transfer) {
  if (!any_wanted) return false;
  any_wanted = false;
  for (uint8_t i = 0; i < BUS_SENSORS; i++) {
    any_wanted = any_wanted || states[i].wanted;
    if (!due(states[i])) continue;
    read(transfer, i);
    return any_wanted = true;
  }
  return false;
}

void transfer_ended(bus::Result result) {
  State& state = states[asked];
  const bool arrived = result == bus::Result::done;
  const bool good = arrived && flash_pointer(&TAKES[asked])(hal::transfer.in, values_of(asked));
  state.known = true;
  if (arrived) state.answered = good;  // bytes without a valid reading may have replaced the last one
  if (good) {
    state.seen = true;
    state.answered_at = board_clock::now();
  }
  state.failed = !good;
}

}  // namespace sensors
}  // namespace mrl
