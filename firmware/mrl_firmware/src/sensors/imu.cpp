#include "imu.h"

#include "../serial/answers.h"
#include "../board/board_clock.h"
#include "../../build.h"
#include "../serial/commands.h"
#include "../hal/flash.h"
#include "../serial/frame_writer.h"
#include "../serial/protocol.h"
#include "../board/status.h"
#include "../serial/stream.h"

namespace mrl {
namespace imu {
namespace {

constexpr uint8_t FIRST_ADDRESS = 0x68, LAST_ADDRESS = 0x69;  // AD0 low, high
constexpr uint8_t START_ADDRESS = MRL_ENVIRONMENT ? LAST_ADDRESS : FIRST_ADDRESS;  // the TPA81 has the first one

constexpr uint32_t PERIOD = board_clock::of_ms(504);  // of the search, and of a look at an IMU that nobody reads
constexpr uint32_t SETTLED = board_clock::of_ms(56);  // the gyro starts in 30 ms, and the low-pass filter in 20 ms

// A checked command takes up to 2.1 ms to arrive, and a reading of 0.7 ms waits for it; but not for a frame without end.
constexpr uint32_t PATIENCE = board_clock::of_ms(3);

// Every chip of the family has another scale after a loss of its power.
constexpr uint8_t GYRO_SCALE = 0x08;  // 500 deg/s

// Many modules that are sold with an MPU-6050 have an ICM-20689, or a copy that gives its identity.
enum Chip : uint8_t { MPU_6050 = 0x68, MPU_6500 = 0x70, MPU_9250 = 0x71, MPU_9255 = 0x73, ICM_20689 = 0x98 };
enum Register : uint8_t {
  SAMPLE_RATE = 0x19,
  GYRO_CONFIG = 0x1B,
  ACCEL_DATA = 0x3B,
  GYRO_DATA = 0x43,
  POWER = 0x6B,
  WHO_AM_I = 0x75,
};

// Steps with a transfer; between the background and the reading there are two pauses.
enum class Step : uint8_t { search, wake, set_up, settle, rest, gyro, accel, check };
struct Transaction {
  uint8_t out[6], out_count, in_count;
};
// Woken with the gyro's clock.  200 Hz; low-pass filters of 42 Hz (gyro) and 44 Hz; 500 deg/s; 2 g; the filter again, for
// the accelerometers of all chips but the MPU-6050.
const Transaction TRANSACTIONS[] PROGMEM = {
    {{WHO_AM_I}, 1, 1}, {{POWER, 1}, 2, 0},  {{SAMPLE_RATE, 4, 3, GYRO_SCALE, 0, 3}, 6, 0}, {}, {},
    {{GYRO_DATA}, 1, 6}, {{ACCEL_DATA}, 1, 6}, {{GYRO_CONFIG}, 1, 1},
};

constexpr uint8_t VECTOR = 6;  // three axes, two bytes each, high byte first
uint8_t data[2 * VECTOR];      // gyro, accelerometer
uint32_t since;                // the last search, look or want(), or the set-up
uint16_t latched;
uint8_t address = START_ADDRESS;
Step step;
rows::Readiness state;
bool reading;
bool found, known;  // `known` is false until both addresses have been tried, which is done at once

bool fill(hal::Transfer& transfer) {
  const uint8_t* const row = reinterpret_cast<const uint8_t*>(&TRANSACTIONS[static_cast<uint8_t>(step)]);
  transfer.address = address;
  for (uint8_t i = 0; i < sizeof Transaction::out; i++) transfer.out[i] = flash_byte(row + i);
  transfer.out_count = flash_byte(row + sizeof Transaction::out);
  transfer.in_count = flash_byte(row + sizeof Transaction::out + 1);
  return true;
}

void next_address() {
  known = known || address == LAST_ADDRESS;
  address = address == LAST_ADDRESS ? START_ADDRESS : LAST_ADDRESS;
}

// An IMU that has answered a moment ago is looked for at once, unless the bus hangs.
void lose(bool hung) {
  if (step == Step::search) next_address();
  if (step > Step::settle && !hung) known = false;
  if (state == rows::Readiness::wait) state = rows::Readiness::impossible;
  reading = false;
  step = Step::search;
  since = board_clock::now();
  status::set_fault(FAULT_IMU, found);
}

bool is_of_family(uint8_t chip) {
  return chip == MPU_6050 || chip == MPU_6500 || chip == MPU_9250 || chip == MPU_9255 || chip == ICM_20689;
}

void take(uint8_t* into) {
  for (uint8_t i = 0; i < VECTOR; i++) into[i] = hal::transfer.in[i];
}

void finish() {
  if (reading) state = rows::Readiness::ready;
  reading = false;
  since = board_clock::now();
  step = Step::rest;
}

}  // namespace

#if MRL_BRIDGE
void forget() {
  found = known = reading = false;
  state = rows::Readiness::impossible;
  step = Step::search;
  address = START_ADDRESS;
  status::set_fault(FAULT_IMU, false);
}
#endif

bool asked() { return known || (MRL_BRIDGE && !bus::in_use()); }

int16_t capabilities() { return found ? CAPABILITY_IMU : 0; }

void want() {
  state = rows::Readiness::impossible;
  if (step <= Step::settle) return;
  state = rows::Readiness::wait;
  since = board_clock::now();
}

rows::Readiness readiness() { return state; }

uint16_t tick() { return latched; }

void report() {
  const uint8_t* high = data;
  for (; high < data + sizeof data; high += 2) writer::add(static_cast<int16_t>(high[0] << 8 | high[1]));
}

bool has_work() { return step > Step::rest || state == rows::Readiness::wait; }

// Each part is short, so that a move or a stop can pass between them; and if one is arriving, it goes first.
bool next_transfer(hal::Transfer& transfer) {
  if (!has_work() || (commands::decoder.in_frame() && !board_clock::passed(since, PATIENCE))) return false;
  if (step == Step::rest && state == rows::Readiness::wait) {
    step = Step::gyro;
    reading = true;
  }
  return fill(transfer);
}

bool next_background(hal::Transfer& transfer) {
  const bool at_once = step == Step::wake || step == Step::set_up || (step == Step::search && !known);
  if (!at_once && !board_clock::passed(since, step == Step::settle ? SETTLED : PERIOD)) return false;
  if (step == Step::settle) {
    status::set_fault(FAULT_IMU, false);
    finish();
    return false;
  }
  if (step == Step::rest) step = Step::check;
  return fill(transfer);
}

void transfer_ended(bus::Result result) {
  const uint8_t byte = hal::transfer.in[0];
  const bool wrong = (step == Step::search && !is_of_family(byte)) || (step == Step::check && byte != GYRO_SCALE);
  if (result != bus::Result::done || wrong) return lose(result == bus::Result::hung);
  if (step == Step::check) return finish();
  if (step == Step::search) found = known = true;
  if (step == Step::set_up) since = board_clock::now();
  if (step == Step::gyro) {
    latched = hal::bus_latched();
    take(data);
  }
  if (step == Step::accel) take(data + VECTOR);
  step = static_cast<Step>(static_cast<uint8_t>(step) + 1);
}

}  // namespace imu

namespace handlers {

void read_imu(const int16_t*, uint8_t) {
  if (!imu::found) return status::refuse(Reason::unavailable);
  answers::ask(READ_IMU);
}

void start_imu_stream(const int16_t* args, uint8_t) {
  if (!imu::found) return status::refuse(Reason::unavailable);
  imu::want();  // its first frame has a reading of its own
  streams::imu.start(READ_IMU, args[0]);
  streams::imu.align(streams::main);
}

void stop_imu_stream(const int16_t*, uint8_t) { streams::imu.stop(READ_IMU); }

}  // namespace handlers
}  // namespace mrl
