#include "hal_pc.h"

#include <string.h>

#include <deque>
#include <vector>

#include "src/board/board.h"
#include "build.h"
#include "src/sensors/environment.h"
#include "src/serial/frame_decoder.h"
#include "src/hal/hal.h"
#include "hal_bridge_pc.h"
#include "src/hal/ring.h"
#include "src/sensors/sonar.h"
#include "src/sensors/sonar_curve.h"

namespace {

constexpr double TICK_US = 64, PASS_US = 16, BITS = 10;
constexpr double ADC_US = 104, EEPROM_WRITE_US = 3400, TRIGGER_US = 10, LONG_ECHO_US = 30720;

// The chip sleeps between passes of the loop.  Here the loop is called on, and must then do nothing: whatever it does
// before its alarm or an interrupt's news would have come too late on the chip.
struct Sleep {
  bool on, acted;
  uint16_t until;
  uint8_t waiting;  // bytes to be sent when it fell asleep: fewer are only seen when they are news
  int too_long;
} asleep;
bool news;

// For everything that the loop does to the hardware or takes from it.
void act() { asleep.acted = true; }

struct Arrival {
  uint8_t byte;
  double time_us;
};

PcWorld world;
double now_us, start_us, line_free_us, out_free_us, kicked_us, longest_gap_us;
uint16_t first_tick;
int flags;

std::deque<Arrival> arriving;
mrl::Ring<64> received;
mrl::Ring<hal::SERIAL_OUT_SIZE> sending;
std::vector<uint8_t> sent;
uint8_t overruns;

hal::BusState bus;
double bus_until_us;
uint16_t latched;
bool hung;
int recoveries_left;

int adc_channel;
double adc_until_us;
uint8_t eeprom[hal::EEPROM_SIZE];
double eeprom_until_us;
struct {
  double begin_us, end_us;
} echo;
bool eeprom_broken;
uint32_t dust_low;
bool dust_seen;
std::deque<uint8_t> radio_in;
std::vector<uint8_t> radio_out;

uint8_t divider;
double host_baud;

double byte_out_us() { return BITS * 8 * (divider + 1) / 16.0; }
double byte_in_us() { return 1e6 * BITS / host_baud; }

// At another speed bytes turn into others.
uint8_t through_line(uint8_t byte) {
  const double ratio = byte_out_us() / byte_in_us();
  return ratio > 0.95 && ratio < 1.05 ? byte : 0xFF;
}

void move_serial() {
  while (!arriving.empty() && arriving.front().time_us <= now_us) {
    if (received.room()) {
      received.put(through_line(arriving.front().byte));
    } else if (overruns != 255) {
      overruns++;
    }
    arriving.pop_front();
  }
  while (sending.used() && out_free_us <= now_us) {
    const double began = out_free_us > now_us - PASS_US ? out_free_us : now_us;
    sent.push_back(through_line(sending.take()));
    news = news || !sending.used() || sending.used() % 8 == hal::SERIAL_OUT_NEWS;
    out_free_us = began + byte_out_us();
  }
}

bool carry_out_transfer() {
  hal::Transfer& transfer = hal::transfer;
  if (transfer.out_count && !world.i2c_write(transfer.address, transfer.out, transfer.out_count, now_us)) return false;
  if (!transfer.in_count) return true;
  latched = hal::ticks();
  return world.i2c_read(transfer.address, transfer.in, transfer.in_count, now_us);
}

void move_bus() {
  if (bus != hal::BusState::busy || hung || now_us < bus_until_us) return;
  bus = carry_out_transfer() ? hal::BusState::idle : hal::BusState::nack;
  news = true;
}

void pass_time(double to_us) {
  const double from_us = now_us;
  now_us = to_us;
  move_serial();
  move_bus();
  if (MRL_BRIDGE) news = bridge_pc::pass_time(now_us) || news;
  for (const double end_us : {adc_until_us, eeprom_until_us, echo.end_us}) news = news || (from_us < end_us && end_us <= to_us);
}

void run_loop() {
  if (asleep.on && (news || received.used() || static_cast<int16_t>(asleep.until - hal::ticks()) <= 0)) asleep.on = false;
  const Sleep before = asleep;
  bridge_pc::take_action();
  asleep.acted = false;
  mrl::board::run();
  asleep.acted = bridge_pc::take_action() || asleep.acted;
  if (!before.on) return;
  asleep.on = true;
  asleep.until = before.until;
  asleep.waiting = before.waiting;
  if (asleep.acted) asleep.too_long++;
}

}  // namespace

namespace hal {

Transfer transfer;

void begin() {}

uint16_t ticks() {
  return static_cast<uint16_t>(first_tick + static_cast<uint64_t>((now_us - start_us) / TICK_US));
}

bool take_news() {
  const bool had = news;
  news = false;
  return had;
}

void sleep_until(uint16_t tick) {
  asleep.on = !news && !received.used() && static_cast<int16_t>(tick - ticks()) > 0;
  asleep.until = tick;
  asleep.waiting = sending.used();
}

int16_t serial_read() {
  if (!received.used()) return -1;
  act();
  return received.take();
}
bool serial_received() { return received.used(); }
void serial_discard() { received.clear(); }
uint8_t serial_room() { return static_cast<uint8_t>(SERIAL_OUT_SIZE - serial_waiting()); }
uint8_t serial_waiting() { return asleep.on ? asleep.waiting : sending.used(); }
void serial_write(uint8_t byte) {
  act();
  sending.put(byte);
}
void serial_speed(uint8_t to) {
  act();
  divider = to;
}
uint8_t serial_overruns() {
  const uint8_t count = overruns;
  overruns = 0;
  return count;
}

void bus_start() {
  const int bytes = 1 + transfer.out_count + (transfer.in_count ? 1 + transfer.in_count : 0);
  act();
  bus = BusState::busy;
  bus_until_us = now_us + (9 * bytes + 3) * (16 + 2 * transfer.divider) / 16.0;
}
BusState bus_state() { return bus; }
uint16_t bus_latched() { return latched; }
void bus_recover() {
  act();
  bus = BusState::idle;
  if (recoveries_left && !--recoveries_left) hung = false;
}

void adc_start(uint8_t channel) {
  act();
  adc_channel = channel;
  adc_until_us = now_us + ADC_US;
}
int16_t adc_result() {
  return now_us < adc_until_us ? static_cast<int16_t>(-1) : static_cast<int16_t>(world.adc(adc_channel, now_us));
}

void pin_output(uint8_t pin, bool level) {
  act();
  world.pin(pin, level, now_us);
}

void pin_release(uint8_t pin) {
  act();
  if (world.release) world.release(pin, now_us);
}

void pin_pull_up(uint8_t) {}
bool pin_level(uint8_t pin) { return bridge_pc::level(pin); }

bool range_fire(uint8_t trigger, uint8_t pin) {
  act();
  if (!world.echo) return true;
  world.echo(pin, &echo.begin_us, &echo.end_us);
  if (echo.begin_us <= now_us && now_us < echo.end_us) return false;
  world.pin(trigger, 1, now_us);
  world.pin(trigger, 0, now_us + TRIGGER_US);
  world.echo(pin, &echo.begin_us, &echo.end_us);
  return true;
}

Echo range_echo(uint16_t& length) {
  const double length_us = echo.end_us - echo.begin_us;
  length = length_us < LONG_ECHO_US ? static_cast<uint16_t>(2 * length_us + 0.5) : LONG_ECHO;
  if (echo.begin_us > now_us || echo.end_us <= 0) return Echo::none;
  return echo.end_us > now_us ? Echo::high : Echo::over;
}

bool eeprom_ready() { return now_us >= eeprom_until_us; }
uint8_t eeprom_read(uint16_t address) { return eeprom[address]; }
void eeprom_write(uint16_t address, uint8_t value) {
  act();
  if (!eeprom_broken) eeprom[address] = value;
  eeprom_until_us = now_us + EEPROM_WRITE_US;
}

ResetTrace reset_trace() {
  ResetTrace trace;
  trace.power_on = flags & PC_POWER_ON;
  trace.external = flags & PC_EXTERNAL;
  trace.brown_out = flags & PC_BROWN_OUT;
  trace.watchdog = flags & PC_WATCHDOG;
  trace.watchdog_marked = flags & PC_MARKED;
  trace.memory_kept = flags & PC_KEPT;
  return trace;
}
void watchdog_kick() {
  bridge_pc::kick(now_us);
  if (now_us - kicked_us > longest_gap_us) longest_gap_us = now_us - kicked_us;
  kicked_us = now_us;
}

void radio_begin() {}
int16_t radio_read() {
  if (radio_in.empty()) return -1;
  act();
  const uint8_t byte = radio_in.front();
  radio_in.pop_front();
  return byte;
}
uint8_t radio_room() { return static_cast<uint8_t>(RADIO_OUT_SIZE - radio_out.size()); }
void radio_write(uint8_t byte) {
  act();
  radio_out.push_back(byte);
}

uint32_t dust_low_ticks() {
  const uint32_t low = dust_low;
  dust_low = 0;
  return low;
}
bool dust_changed() {
  const bool seen = dust_seen;
  dust_seen = false;
  return seen;
}

}  // namespace hal

void pc_start(const PcWorld* outside, double time_us, uint16_t tick, int reset_flags, const uint8_t* image) {
  world = *outside;
  now_us = start_us = kicked_us = line_free_us = out_free_us = time_us;
  first_tick = tick;
  flags = reset_flags;
  divider = hal::SERIAL_DIVIDER;
  host_baud = 115200;
  asleep = Sleep();
  memcpy(eeprom, image, sizeof eeprom);
  bridge_pc::begin(world, now_us, first_tick);
  mrl::board::begin();
}

double pc_advance(double time_us) {
  while (now_us < time_us) {
    pass_time(now_us + PASS_US);
    run_loop();
  }
  return now_us;
}

void pc_stall(double time_us) {
  pass_time(time_us > now_us ? time_us : now_us);
  asleep.on = false;
}

double pc_now_us() { return now_us; }

void pc_set_host_baud(double baud) { host_baud = baud; }

void pc_receive(uint8_t byte) {
  line_free_us = (line_free_us > now_us ? line_free_us : now_us) + byte_in_us();
  arriving.push_back({byte, line_free_us});
}

// A byte counts as sent when its stop bit has left.
int pc_sent(uint8_t* bytes, int room) {
  size_t count = sent.size();
  if (out_free_us > now_us && count) count--;
  if (count > static_cast<size_t>(room)) count = static_cast<size_t>(room);
  if (!count) return 0;
  memcpy(bytes, sent.data(), count);
  sent.erase(sent.begin(), sent.begin() + static_cast<long>(count));
  return static_cast<int>(count);
}

void pc_hang_bus(int on, int recoveries) {
  hung = on;
  recoveries_left = recoveries;
}

void pc_dust(uint32_t low_ticks) {
  dust_low += low_ticks;
  dust_seen = true;
}

void pc_radio_receive(uint8_t byte) {
  radio_in.push_back(byte);
  news = true;
}

int pc_radio_sent(uint8_t* bytes, int room) {
  int count = 0;
  for (; count < room && count < static_cast<int>(radio_out.size()); count++) bytes[count] = radio_out[static_cast<size_t>(count)];
  radio_out.erase(radio_out.begin(), radio_out.begin() + count);
  return count;
}

const uint8_t* pc_eeprom() { return eeprom; }

void pc_break_eeprom(int on) { eeprom_broken = on; }

int pc_slept_too_long() { return asleep.too_long; }

double pc_longest_kick_gap_us() { return longest_gap_us; }

static mrl::FrameDecoder decoder;

void pc_decoder_start(int checked, int asked, int plain_calibrate) {
  decoder = mrl::FrameDecoder();
  decoder.checked = checked;
  decoder.asked = asked;
  decoder.plain_calibrate = plain_calibrate;
}
int pc_decoder_feed(uint8_t byte) { return static_cast<int>(decoder.feed(byte)); }
int pc_decoder_code() { return decoder.code(); }
int pc_decoder_count() { return decoder.count(); }
const int16_t* pc_decoder_arguments() { return decoder.arguments(); }
int pc_decoder_reason() { return static_cast<int>(decoder.reason()); }
int pc_decoder_length() { return decoder.length(); }

int pc_power_law(int count, int a, int b, int c) {
  mrl::PowerLaw curve;
  curve.set(static_cast<int16_t>(a), static_cast<int16_t>(b), static_cast<int16_t>(c));
  return curve.at(static_cast<uint16_t>(count));
}
int pc_range_cm(int count) { return mrl::sonar::range_cm(static_cast<uint16_t>(count)); }
int pc_dust_per_litre(uint32_t low, uint32_t total) { return mrl::dust_per_litre(low, total); }
