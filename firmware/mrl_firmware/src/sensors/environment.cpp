#include "../../build.h"

#if MRL_ENVIRONMENT

#include "environment.h"

#include "../board/board_clock.h"
#include "dust.h"
#include "../hal/hal.h"
#include "../../pins.h"
#include "../serial/protocol.h"

namespace mrl {
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
}  // namespace mrl

#endif
