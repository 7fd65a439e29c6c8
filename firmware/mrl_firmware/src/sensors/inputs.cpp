#include "../../build.h"

#if MRL_BRIDGE

#include "inputs.h"

#include "../serial/answers.h"
#include "../board/board_clock.h"
#include "../board/config.h"
#include "../serial/frame_writer.h"
#include "../hal/hal.h"
#include "../board/wiring.h"

namespace mrl {
namespace inputs {
namespace {

constexpr uint8_t COUNT = 6;
constexpr uint32_t PERIOD = board_clock::of_ms(1);
constexpr uint8_t BUMPERS = INPUT_BUMPER_LEFT | INPUT_BUMPER_RIGHT | INPUT_BUMPER_REAR;
constexpr uint8_t CLIFFS = INPUT_CLIFF_LEFT | INPUT_CLIFF_RIGHT;
constexpr uint8_t REAR = INPUT_BUMPER_REAR | INPUT_EMERGENCY_STOP, FRONT = BUMPERS - INPUT_BUMPER_REAR + CLIFFS;

uint32_t looked_at;
int8_t pins[COUNT];  // as they were when the wiring came in force
uint8_t fitted;      // one bit for each input that has a pin
uint8_t seen;        // those that were active in the last look
uint8_t now_active;  // in the last two
bool latched;

// The inputs that are active when their pins are low.
uint8_t active_low() {
  return static_cast<uint8_t>((config::get(Parameter::bumpers_high) ? 0 : BUMPERS) |
                              (config::get(Parameter::cliffs_low) ? CLIFFS : 0));
}

uint8_t look() {
  uint8_t high = 0;
  for (uint8_t i = 0; i < COUNT; i++) {
    if (fitted >> i & 1 && hal::pin_level(static_cast<uint8_t>(pins[i]))) high = static_cast<uint8_t>(high | 1 << i);
  }
  return fitted & static_cast<uint8_t>(high ^ active_low());
}

}  // namespace

void begin() {
  for (uint8_t i = 0; i < COUNT; i++) {
    pins[i] = wiring::pin(static_cast<Parameter>(static_cast<uint8_t>(Parameter::pin_bumper_left) + i));
    if (pins[i] < 0) continue;
    hal::pin_pull_up(static_cast<uint8_t>(pins[i]));
    fitted = static_cast<uint8_t>(fitted | 1 << i);
  }
  seen = now_active = fitted;
  looked_at = board_clock::now();
  latched = latched && (fitted & INPUT_EMERGENCY_STOP);
}

void end() {
  for (uint8_t i = 0; i < COUNT; i++) {
    if (fitted >> i & 1) hal::pin_release(static_cast<uint8_t>(pins[i]));
  }
  fitted = now_active = 0;
}

bool service() {
  if (!fitted || !board_clock::passed(looked_at, PERIOD)) return false;
  looked_at = board_clock::now();
  const uint8_t now = look();
  now_active = now & seen;
  seen = now;
  if (now_active & INPUT_EMERGENCY_STOP) latched = true;
  return true;
}

StopReason against(bool backward) {
  if (latched || (now_active & INPUT_EMERGENCY_STOP)) return StopReason::emergency_stop;
  const uint8_t side = now_active & (backward ? REAR : FRONT);
  if (side & BUMPERS) return StopReason::bumper;
  return side ? StopReason::cliff : StopReason::none;
}

uint8_t connected() { return fitted; }

uint8_t active() { return now_active; }

void report() {
  writer::add(now_active);
  writer::add(latched);
  writer::add(fitted);
}

}  // namespace inputs

namespace handlers {

void release_emergency(const int16_t*, uint8_t) {
  if (!(inputs::now_active & INPUT_EMERGENCY_STOP)) inputs::latched = false;
  answers::ask(RELEASE_EMERGENCY, inputs::latched);
}

}  // namespace handlers
}  // namespace mrl

#endif
