#include "i2c_sensors.h"

#include "board_clock.h"
#include "frame_writer.h"
#include "protocol.h"

namespace mrl {
namespace i2c_sensors {
namespace {

constexpr uint8_t SLOW_DIVIDER = 72;  // 100 kHz
constexpr uint8_t THERMOPILE_ADDRESS = 0x68, FIRST_PIXEL = 2, PIXELS = 8;
constexpr uint8_t COMPASS_ADDRESS = 0x60, BEARING = 2;
constexpr uint32_t READ_PERIOD = board_clock::of_ms(48);
constexpr uint32_t WANTED_FOR = board_clock::of_ms(2000);
constexpr uint32_t VALID_FOR = board_clock::of_ms(504);

struct Sensor {
  uint32_t wanted_at, asked_at, answered_at;
  bool wanted, known, answered, failed;
};

Sensor thermopile, compass;
Sensor* asked;
uint8_t pixels[PIXELS];
int16_t bearing_deg;

void want(Sensor& sensor) {
  if (!sensor.wanted) {
    sensor.known = sensor.answered = sensor.failed = false;
    sensor.asked_at = board_clock::now() - READ_PERIOD;
  }
  sensor.wanted = true;
  sensor.wanted_at = board_clock::now();
}

bool valid(const Sensor& sensor) { return sensor.answered && !board_clock::passed(sensor.answered_at, VALID_FOR); }

bool due(Sensor& sensor) {
  if (sensor.wanted && board_clock::passed(sensor.wanted_at, WANTED_FOR)) sensor.wanted = false;
  return sensor.wanted && board_clock::passed(sensor.asked_at, READ_PERIOD);
}

bool read(hal::Transfer& transfer, Sensor& sensor, uint8_t address, uint8_t from, uint8_t count) {
  asked = &sensor;
  sensor.asked_at = board_clock::now();
  transfer.address = address;
  transfer.divider = SLOW_DIVIDER;
  transfer.out_count = 1;
  transfer.out[0] = from;
  transfer.in_count = count;
  return true;
}

void take_pixels() {
  for (uint8_t i = 0; i < PIXELS; i++) pixels[i] = hal::transfer.in[i];
}

// A bearing beyond the circle is no bearing: the sensor answered nonsense.
bool take_bearing() {
  const uint16_t tenths = static_cast<uint16_t>(hal::transfer.in[0] << 8 | hal::transfer.in[1]);
  if (tenths >= 3600) return false;
  bearing_deg = static_cast<int16_t>(tenths / 10);
  return true;
}

}  // namespace

void want_thermopile() { want(thermopile); }
void want_compass() { want(compass); }
bool thermopile_valid() { return valid(thermopile); }
bool compass_valid() { return valid(compass); }
bool thermopile_known() { return thermopile.known; }
bool compass_known() { return compass.known; }
int16_t bearing() { return bearing_deg; }
bool failing() { return (thermopile.wanted && thermopile.failed) || (compass.wanted && compass.failed); }

int16_t hottest() {
  uint8_t most = 0;
  for (uint8_t i = 0; i < PIXELS; i++) most = pixels[i] > most ? pixels[i] : most;
  return most;
}

void report_pixels() {
  for (uint8_t i = 0; i < PIXELS; i++) writer::add(pixels[i]);
}

bool next_transfer(hal::Transfer& transfer) {
  if (due(thermopile)) return read(transfer, thermopile, THERMOPILE_ADDRESS, FIRST_PIXEL, PIXELS);
  if (due(compass)) return read(transfer, compass, COMPASS_ADDRESS, BEARING, 2);
  return false;
}

void transfer_ended(bus::Result result) {
  bool good = result == bus::Result::done;
  if (good && asked == &thermopile) take_pixels();
  if (good && asked == &compass) good = take_bearing();
  asked->known = true;
  if (good) {
    asked->answered = true;
    asked->answered_at = board_clock::now();
  }
  asked->failed = !good;
}

}  // namespace i2c_sensors
}  // namespace mrl
