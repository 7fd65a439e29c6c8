#include "../../build.h"

#if MRL_BRIDGE && !MRL_VIRTUAL

#include "battery.h"

#include "../board/board_clock.h"
#include "../board/config.h"
#include "../hal/hal.h"
#include "../hal/chip.h"
#include "../serial/protocol.h"
#include "ranges.h"
#include "sonar.h"
#include "../board/wiring.h"

namespace mrl {
namespace battery {
namespace {

constexpr uint32_t PERIOD = board_clock::of_ms(8);
constexpr uint8_t CONVERSIONS = 16;

// 1024 counts are 5 V: a sum of 16 counts times a divider in thousandths, shifted by 15, is 0.01 V.
constexpr uint8_t SUM_SHIFT = 15;
static_assert(CONVERSIONS * 1024UL * 1000 == (1UL << SUM_SHIFT) * 500, "5 V are 500 times 0.01 V");

uint32_t started_at;
uint16_t sum, whole_sum;
uint8_t conversions;
bool running, known;

void start() {
  started_at = board_clock::now();
  running = true;
  hal::adc_start(chip::channel(static_cast<uint8_t>(wiring::pin(Parameter::pin_battery))));
}

void take_conversion() {
  const int16_t count = hal::adc_result();
  if (count < 0) return;
  running = false;
  sum = static_cast<uint16_t>(sum + count);
  if (++conversions < CONVERSIONS) return;
  whole_sum = sum;
  known = true;
  sum = conversions = 0;
}

}  // namespace

void begin() {
  started_at = board_clock::now();
  running = known = false;
  sum = conversions = 0;
}

bool connected() { return config::get(Parameter::battery_divider) && wiring::pin(Parameter::pin_battery) >= 0; }

void service() {
  if (running) return take_conversion();
  if (!connected()) {
    known = false;
  } else if (board_clock::passed(started_at, PERIOD) && !sonar::converting() && !ranges::converting()) {
    start();
  }
}

bool converting() { return running; }

bool measured() { return known; }

int16_t centivolts() {
  const uint32_t divider = static_cast<uint16_t>(config::get(Parameter::battery_divider));
  return static_cast<int16_t>(whole_sum * divider >> SUM_SHIFT);
}

}  // namespace battery
}  // namespace mrl

#endif
