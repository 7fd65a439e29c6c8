// The firmware's PC build with a motor board in C++, whose whole state is copied out and in: see board.py.
//
// All state of the firmware, of its hardware and of the motor board is static.  It is the writable part of this library
// behind what the loader has made read-only; containers on the heap are written into a small area of their own.
#include <link.h>

#include "src/serial/commands.h"

#include "../../../firmware/hal_pc.cpp"

namespace {

constexpr double MS = 1000;
constexpr double METRES_PER_COUNT = 8.7512033e-5, HALF_AXLE_M = 0.090;
constexpr uint8_t ADDRESS = 0x18;
constexpr int KEY_TICKS = 312, KEY_MOST = 40;  // 20 ms; ages above 0.8 s are alike

// What the motors have done, for the judge.  Times are the board's [us].
struct Truth {
  double turned_us;       // the motors turned last
  double moved_us;        // a command to turn was carried out last
  double stopped_us;      // a stop was carried out while the motors turned
  double quiet_us;        // the motor board stopped because nobody spoke to it, while the motors turned
  double late_us;         // the longest time that the motors have turned after the last undamaged frame
  int32_t turning, slept_too_long;
};

struct MotorBoard {
  double at_us, traffic_us, timeout_us, busy_us;
  double travel[2];  // left, right [count]
  double speed[2];   // [count/s]
  double battery_v;
  uint8_t reg, absent, refuse_stops, blocked;
} motors;

Truth truth;
double intact_us;  // the last byte of an undamaged frame reaches the board

bool turning() { return motors.speed[0] != 0 || motors.speed[1] != 0; }

void travel_to(double to_us) {
  if (to_us <= motors.at_us) return;
  if (turning()) {
    const double quiet_us = motors.traffic_us + motors.timeout_us;
    const double end_us = motors.timeout_us > 0 && quiet_us < to_us ? (quiet_us > motors.at_us ? quiet_us : motors.at_us) : to_us;
    for (int i = 0; i < 2 && !motors.blocked; i++) motors.travel[i] += motors.speed[i] * (end_us - motors.at_us) * 1e-6;
    truth.turned_us = end_us;
    if (end_us - intact_us > truth.late_us) truth.late_us = end_us - intact_us;
    if (end_us < to_us) {
      motors.speed[0] = motors.speed[1] = 0;
      truth.quiet_us = end_us;
    }
  }
  motors.at_us = to_us;
}

int16_t word_at(const uint8_t* data) { return static_cast<int16_t>(data[0] << 8 | data[1]); }

void set_speeds(double left, double right) {
  motors.speed[0] = left;
  motors.speed[1] = right;
  if (turning()) truth.moved_us = motors.at_us;
}

int motor_write(uint8_t address, const uint8_t* data, int count, double time_us) {
  travel_to(time_us);
  if (address != ADDRESS || motors.absent || !count) return 0;
  if (data[0] == 0xFC && motors.refuse_stops && !(time_us < motors.busy_us)) {
    motors.refuse_stops--;
    return 0;
  }
  motors.traffic_us = time_us;
  motors.reg = data[0];
  switch (data[0]) {
    case 0xFC:
      if (turning()) truth.stopped_us = time_us;
      motors.speed[0] = motors.speed[1] = 0;
      break;
    case 0xEB: {
      const double linear = word_at(data + 1) / 1000.0, turn = word_at(data + 3) / 1000.0 * HALF_AXLE_M;
      set_speeds((linear - turn) / METRES_PER_COUNT, (linear + turn) / METRES_PER_COUNT);
      break;
    }
    case 0xF1:
      motors.timeout_us = data[1] * 100 * MS;
      motors.busy_us = time_us + 5 * MS;
      break;
    case 0xF4:
      motors.busy_us = time_us + 15 * MS;
      break;
    case 0xEC:
    case 0xF0:
      motors.busy_us = time_us + 10 * MS;
      break;
    case 0xEA:
      motors.busy_us = time_us + 20 * MS;
      break;
    default:
      break;
  }
  return 1;
}

void put_word(uint8_t* data, int value) {
  data[0] = static_cast<uint8_t>(value >> 8);
  data[1] = static_cast<uint8_t>(value);
}

int motor_read(uint8_t address, uint8_t* data, int count, double time_us) {
  travel_to(time_us);
  if (address != ADDRESS || motors.absent) return 0;
  motors.traffic_us = time_us;
  memset(data, 0xFF, static_cast<size_t>(count));
  switch (motors.reg) {
    case 0xFE:
      data[0] = 1;
      break;
    case 0xFD:
      data[0] = 72;
      break;
    case 0xD5:
      put_word(data, static_cast<int>(motors.battery_v * 10));
      break;
    case 0xD4:
      put_word(data, 250);
      break;
    case 0xD8:
      put_word(data, static_cast<int>(motors.travel[0]));
      put_word(data + 2, 0);
      put_word(data + 4, static_cast<int>(motors.travel[1]));
      break;
    default:
      break;
  }
  return 1;
}

int adc_value(int, double) { return 100; }
void pin_changed(int, int, double) {}
void bridge_changed(int, int, int, int, int, double) {}
int level_of(int) { return 1; }

const PcWorld WORLD = {motor_write, motor_read, adc_value, pin_changed, bridge_changed, level_of};

// ---- the writable memory of this library

struct Memory {
  uint8_t* first;
  size_t size;
};

int find_memory(dl_phdr_info* info, size_t, void* found) {
  const uintptr_t mine = reinterpret_cast<uintptr_t>(&motors);
  uintptr_t first = 0, last = 0, fixed = 0;
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const ElfW(Phdr)& part = info->dlpi_phdr[i];
    const uintptr_t at = info->dlpi_addr + part.p_vaddr;
    if (part.p_type == PT_LOAD && (part.p_flags & PF_W) && at <= mine && mine < at + part.p_memsz) {
      first = at;
      last = at + part.p_memsz;
    }
    if (part.p_type == PT_GNU_RELRO) fixed = (at + part.p_memsz + 0xFFF) & ~static_cast<uintptr_t>(0xFFF);
  }
  if (!first) return 0;
  if (fixed > first && fixed < last) first = fixed;
  *static_cast<Memory*>(found) = {reinterpret_cast<uint8_t*>(first), last - first};
  return 1;
}

const Memory& memory() {
  static Memory found;
  if (!found.size) dl_iterate_phdr(find_memory, &found);
  return found;
}

constexpr size_t WAITING = 512;
struct Waiting {
  uint32_t count;
  Arrival bytes[WAITING];
};

// Copies all state out; what is on the heap is written behind it.  `arriving` and `sent` keep their own memory.
void copy_out(uint8_t* to) {
  memcpy(to, memory().first, memory().size);
  Waiting waiting;
  waiting.count = 0;
  for (const Arrival& each : arriving) {
    if (waiting.count < WAITING) waiting.bytes[waiting.count++] = each;
  }
  const size_t used = sizeof waiting.count + 8 + waiting.count * sizeof(Arrival);
  memcpy(to + memory().size, &waiting, used);
}

void copy_in(const uint8_t* from) {
  alignas(std::deque<Arrival>) uint8_t line[sizeof arriving];
  alignas(std::vector<uint8_t>) uint8_t out[sizeof sent], radio[sizeof radio_out];
  alignas(std::deque<uint8_t>) uint8_t air[sizeof radio_in];
  memcpy(line, static_cast<void*>(&arriving), sizeof line);
  memcpy(out, static_cast<void*>(&sent), sizeof out);
  memcpy(radio, static_cast<void*>(&radio_out), sizeof radio);
  memcpy(air, static_cast<void*>(&radio_in), sizeof air);
  memcpy(memory().first, from, memory().size);
  memcpy(static_cast<void*>(&arriving), line, sizeof line);
  memcpy(static_cast<void*>(&sent), out, sizeof out);
  memcpy(static_cast<void*>(&radio_out), radio, sizeof radio);
  memcpy(static_cast<void*>(&radio_in), air, sizeof air);
  arriving.clear();
  sent.clear();
  Waiting waiting;
  memcpy(&waiting.count, from + memory().size, sizeof waiting.count);
  memcpy(&waiting, from + memory().size, sizeof waiting.count + 8 + waiting.count * sizeof(Arrival));
  for (uint32_t i = 0; i < waiting.count; i++) arriving.push_back(waiting.bytes[i]);
}

std::vector<uint8_t>& pristine() {
  static std::vector<uint8_t>& bytes = *new std::vector<uint8_t>;
  return bytes;
}

// The loop sleeps until its alarm or news: time may jump to the first of what can end its sleep.
double next_pass(double to_us) {
  if (!asleep.on || news || received.used()) return now_us + PASS_US;
  const int left = static_cast<int16_t>(asleep.until - hal::ticks());
  if (left <= 0) return now_us + PASS_US;
  const double whole = static_cast<double>(static_cast<uint64_t>((now_us - start_us) / TICK_US));
  double next_us = start_us + (whole + left) * TICK_US;
  if (!arriving.empty() && arriving.front().time_us < next_us) next_us = arriving.front().time_us;
  if ((sending.used() || out_free_us > now_us) && out_free_us < next_us) next_us = out_free_us;
  if (bus == hal::BusState::busy && !hung && bus_until_us < next_us) next_us = bus_until_us;
  for (const double end_us : {adc_until_us, eeprom_until_us}) {
    if (end_us > now_us && end_us < next_us) next_us = end_us;
  }
  if (next_us > to_us) next_us = to_us;
  const double passes = static_cast<double>(static_cast<int64_t>((next_us - now_us) / PASS_US + 0.999999));
  return now_us + (passes < 1 ? 1 : passes) * PASS_US;
}

bool frame_has_left() { return !sent.empty() && sent.back() == '\n' && !sending.used() && out_free_us <= now_us; }

}  // namespace

extern "C" {

// Begins with a board that was switched on, and with a motor board that stands.
void ex_begin(double battery_v, const uint8_t* image) {
  sent.reserve(1 << 16);
  motors = MotorBoard();
  motors.battery_v = battery_v;
  truth = Truth();
  intact_us = -1e9;
  pristine().assign(memory().size + sizeof(Waiting), 0);
  copy_out(pristine().data());
  pc_start(&WORLD, 0, 0, PC_POWER_ON, image);
}

// The reset line: RAM of the firmware starts again; the motor board and EEPROM go on.
void ex_reset() {
  uint8_t image[hal::EEPROM_SIZE];
  memcpy(image, eeprom, sizeof image);
  const double time_us = now_us, last_us = intact_us;
  const MotorBoard board = motors;
  const Truth past = truth;
  copy_in(pristine().data());
  motors = board;
  truth = past;
  intact_us = last_us;
  pc_start(&WORLD, time_us, 0, PC_EXTERNAL | PC_KEPT, image);
}

int ex_size() { return static_cast<int>(memory().size + sizeof(Waiting)); }
int ex_static_size() { return static_cast<int>(memory().size); }
void* ex_memory() { return memory().first; }
void ex_save(uint8_t* to) { copy_out(to); }
void ex_restore(const uint8_t* from) { copy_in(from); }

// Another board, whose image was saved before, takes the place of this one: it has run on its own since then.
void ex_exchange(const uint8_t* image, int counts) {
  const double time_us = now_us;
  const Truth past = truth;
  const double travel[2] = {motors.travel[0], motors.travel[1]};
  copy_in(image);
  const double later_us = time_us - now_us;
  for (double* each : {&now_us, &start_us, &line_free_us, &out_free_us, &kicked_us, &motors.at_us, &motors.traffic_us}) *each += later_us;
  for (double* each : {&bus_until_us, &adc_until_us, &eeprom_until_us, &motors.busy_us, &intact_us}) *each += later_us;
  for (Arrival& each : arriving) each.time_us += later_us;
  for (int i = 0; i < 2; i++) motors.travel[i] = travel[i] + counts;
  truth = past;
}

// Bytes from the host; `intact` says that their frames are not damaged.
void ex_receive(const uint8_t* bytes, int count, int intact) {
  travel_to(now_us);
  for (int i = 0; i < count; i++) {
    pc_receive(bytes[i]);
    if (intact && bytes[i] == 'e') intact_us = line_free_us;
  }
}

// Runs until a time, or until a frame has left; returns the bytes that have left.
int ex_run(double to_us, uint8_t* bytes, int room) {
  while (now_us < to_us && !frame_has_left()) {
    pass_time(next_pass(to_us));
    run_loop();
  }
  travel_to(now_us);
  truth.turning = turning();
  truth.slept_too_long = asleep.too_long;
  return pc_sent(bytes, room);
}

const Truth* ex_truth() { return &truth; }
double ex_intact_us() { return intact_us; }
void ex_refuse_stops(int count) { motors.refuse_stops = static_cast<uint8_t>(count); }
void ex_absent(int on) {
  travel_to(now_us);
  if (on) motors.speed[0] = motors.speed[1] = 0;  // its power is off
  motors.absent = static_cast<uint8_t>(on);
}
void ex_block(int on) {
  travel_to(now_us);
  motors.blocked = static_cast<uint8_t>(on);
}
void ex_battery(double volts) { motors.battery_v = volts; }
int ex_turning() { return turning(); }

// ---- the key: static memory in the form in which two states are alike

struct Field {
  int32_t offset, size, kind;  // 0: as it is; 1: 32-bit time [tick]; 2: 32-bit time [tick/8]; 3: time [us]
};

static uint8_t rounded(double age_ticks) {
  const double whole = age_ticks / KEY_TICKS;
  return static_cast<uint8_t>(whole > KEY_MOST ? KEY_MOST : whole < -KEY_MOST ? 256 - KEY_MOST : static_cast<int>(whole) & 0xFF);
}

int ex_key(const Field* fields, int count, uint32_t now_ticks, uint8_t* key) {
  const uint8_t* base = memory().first;
  uint8_t* out = key;
  for (int i = 0; i < count; i++) {
    const Field& field = fields[i];
    const uint8_t* at = base + field.offset;
    uint32_t ticks;
    double time_us;
    switch (field.kind) {
      case 0:
        memcpy(out, at, static_cast<size_t>(field.size));
        out += field.size;
        break;
      case 1:
        memcpy(&ticks, at, sizeof ticks);
        *out++ = rounded(static_cast<int32_t>(now_ticks - ticks));
        break;
      case 2:
        memcpy(&ticks, at, sizeof ticks);
        *out++ = rounded(static_cast<int32_t>(now_ticks * 8 - ticks) / 8.0);
        break;
      default:
        memcpy(&time_us, at, sizeof time_us);
        *out++ = rounded((now_us - time_us) / TICK_US);
    }
  }
  *out++ = received.used();
  *out++ = static_cast<uint8_t>(arriving.size());
  *out++ = mrl::commands::decoder.checked;
  *out++ = mrl::commands::decoder.in_frame();
  *out++ = static_cast<uint8_t>(motors.speed[0] > 0 ? 1 : motors.speed[0] < 0 ? 2 : 0);
  *out++ = static_cast<uint8_t>(motors.speed[1] > 0 ? 1 : motors.speed[1] < 0 ? 2 : 0);
  *out++ = motors.absent;
  *out++ = motors.refuse_stops;
  *out++ = motors.blocked;
  *out++ = static_cast<uint8_t>(motors.battery_v);
  *out++ = rounded((now_us - motors.traffic_us) / TICK_US);
  *out++ = rounded((now_us - intact_us) / TICK_US);
  for (const Arrival& each : arriving) *out++ = each.byte;
  return static_cast<int>(out - key);
}
}
