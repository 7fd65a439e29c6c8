#include "environment.h"

#include "../board/board_clock.h"
#include "../../build.h"
#include "../hal/hal.h"
#include "../../pins.h"
#include "../serial/protocol.h"

namespace mrl {

// The sensor's characteristic, p = 1.1 r^3 - 3.8 r^2 + 520 r particles per 0.01 cubic feet (0.2832 l) at r percent
// of the time low.  Here r is in 1/100 percent, and 0 stays 0.
int16_t dust_per_litre(uint32_t low, uint32_t total) {
  if (!total) return 0;
  const uint32_t share = low >= total ? 10000 : low * 1000 / (total / 10 ? total / 10 : 1);
  if (share > 4000) return INT16_MAX;
  const int32_t r = static_cast<int32_t>(share);
  const int32_t slope = 52000 + 11 * r * r / 1000 - 38 * r / 10;  // hundredths of particles per percent
  const int32_t particles = slope * r / 10000;
  const int32_t per_litre = particles * 10000 / 2832;
  return static_cast<int16_t>(per_litre > INT16_MAX ? INT16_MAX : per_litre);
}

#if MRL_ENVIRONMENT

namespace environment {
namespace {

// The dust sensor's pulses are rare: its characteristic is valid for half a minute, stored here as six slots.
constexpr uint32_t SLOT = board_clock::of_ms(5000);
constexpr uint8_t SLOTS = 6;
constexpr uint8_t SILENT_SLOTS = 12;  // a minute without one pulse: no sensor

uint32_t low_ticks[SLOTS];
uint32_t slot_began;
uint8_t slot, slots_filled, silent_slots;
constexpr uint32_t NEXT_INPUT = board_clock::of_ms(8);
int16_t alcohol_count, light_count;
uint32_t converted_at;
bool converting, converting_light;

void convert() {
  converted_at = board_clock::now();
  converting = true;
  hal::adc_start(chip::channel(converting_light ? pins::LIGHT : pins::ALCOHOL));
}

void take_conversion() {
  const int16_t count = hal::adc_result();
  if (count < 0) return;
  (converting_light ? light_count : alcohol_count) = count;
  converting_light = !converting_light;
  converting = false;
}

// The two inputs take turns.
void service_inputs() {
  if (converting) take_conversion();
  if (!converting && board_clock::passed(converted_at, NEXT_INPUT)) convert();
}

void next_slot() {
  slot_began += SLOT;
  slot = static_cast<uint8_t>((slot + 1) % SLOTS);
  if (slots_filled < SLOTS) slots_filled++;
  low_ticks[slot] = 0;
  if (hal::dust_changed()) {
    silent_slots = 0;
  } else if (silent_slots < SILENT_SLOTS) {
    silent_slots++;
  }
}

void service_dust() {
  low_ticks[slot] += hal::dust_low_ticks();
  if (board_clock::passed(slot_began, SLOT)) next_slot();
}

}  // namespace

void begin() {
  hal::pin_output(pins::ALCOHOL_HEATER, false);
  hal::pin_output(pins::FAN, true);
  convert();
  slot_began = board_clock::now();
}

void service() {
  service_inputs();
  service_dust();
}

bool silent() { return silent_slots == SILENT_SLOTS; }

}  // namespace environment

namespace sensors {

using namespace environment;

int16_t alcohol() { return static_cast<int16_t>(1023 - alcohol_count); }

int16_t light() { return light_count; }

// Particles per litre.
int16_t dust() {
  uint32_t low = 0;
  for (uint8_t i = 0; i < SLOTS; i++) low += low_ticks[i];
  const uint8_t whole = slots_filled < SLOTS ? slots_filled : SLOTS - 1;
  return dust_per_litre(low, whole * SLOT + (board_clock::now() - slot_began));
}

}  // namespace sensors

#endif

}  // namespace mrl
