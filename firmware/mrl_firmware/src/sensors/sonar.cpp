#include "sonar.h"

#include "../serial/answers.h"
#include "battery.h"
#include "../board/board_clock.h"
#include "../../build.h"
#include "../board/config.h"
#include "../serial/frame_writer.h"
#include "../hal/chip.h"
#include "../hal/hal.h"
#include "../../pins.h"
#include "../serial/protocol.h"
#include "ranges.h"
#include "sonar_curve.h"
#include "../board/wiring.h"
#include "../virtual/virtual_robot.h"

namespace mrl {
namespace sonar {

// Below the lowest count nothing is connected, above the highest the input is saturated; the MB1300 ends its
// range at 645 cm, which it gives as about 645 counts.
constexpr uint16_t LOWEST_COUNT = 10, NOTHING_FROM = 640, HIGHEST_COUNT = 700;

static PowerLaw curve;

int16_t range_cm(uint16_t count) {
  if (count < LOWEST_COUNT || count > HIGHEST_COUNT) return SONAR_INVALID;
  if (count >= NOTHING_FROM) return SONAR_NOTHING;
  return curve.at(count);
}

void configure() {
  curve.set(config::get(Parameter::sonar_a), config::get(Parameter::sonar_b), config::get(Parameter::sonar_c));
}

constexpr uint8_t COUNT = 3;
static int16_t ranges[COUNT];

void report() {
  for (uint8_t i = 0; i < COUNT; i++) writer::add(MRL_ENVIRONMENT ? SONAR_INVALID : ranges[i]);
}

#if !MRL_ENVIRONMENT
namespace {

constexpr uint32_t WARM_UP = board_clock::of_ms(264);  // 250 ms per the data sheet; at the start the time is 8 ms old
constexpr uint32_t TRIGGER = 2;  // ticks; the MB1300 needs at least 20 us
constexpr uint32_t READING = board_clock::of_ms(104);  // 99 ms per the data sheet

enum class Step : uint8_t { warm_up, trigger, ranging, converting, off };
Step step = MRL_BRIDGE ? Step::off : Step::warm_up;
uint32_t since;
uint8_t fired;    // sensors that have fired since the last trigger
uint8_t ready;    // sensors that have fired at all
uint8_t channel;  // input that is being converted

void go(Step next) {
  step = next;
  since = board_clock::now();
}

#if MRL_BRIDGE
int8_t trigger = NOT_CONNECTED, power = NOT_CONNECTED;

int8_t input(uint8_t which) {
  if (MRL_VIRTUAL) return static_cast<int8_t>(chip::FIRST_ANALOG + which);
  return wiring::pin(static_cast<Parameter>(static_cast<uint8_t>(Parameter::pin_sonar_front) + which));
}

void set(int8_t pin, bool level) {
  if (pin != NOT_CONNECTED) hal::pin_output(static_cast<uint8_t>(pin), level);
}

void release(int8_t& pin) {
  if (pin != NOT_CONNECTED) hal::pin_release(static_cast<uint8_t>(pin));
  pin = NOT_CONNECTED;
}
#else
constexpr uint8_t trigger = pins::SONAR_TRIGGER, power = pins::SONAR_POWER;
static_assert(pins::SONAR_LEFT == pins::SONAR_FRONT + 1 && pins::SONAR_RIGHT == pins::SONAR_FRONT + 2,
              "the chain runs front, left, right along the inputs");

int8_t input(uint8_t which) { return static_cast<int8_t>(pins::SONAR_FRONT + which); }

void set(uint8_t pin, bool level) { hal::pin_output(pin, level); }
#endif

void start_chain() {
  fired = 0;
  set(trigger, true);
  go(Step::trigger);
}

// Converts the next input that is connected, or waits for the next turn.
void convert(uint8_t which) {
  while (MRL_BRIDGE && which < COUNT && input(which) < 0) which++;
  if (which < COUNT) {
    channel = which;
    hal::adc_start(chip::channel(static_cast<uint8_t>(input(which))));
    step = Step::converting;
  } else if (fired == COUNT) {
    start_chain();
  } else {
    since += READING;
    step = Step::ranging;
  }
}

// A sensor holds its output until it fires again: all sensors are read after each turn.
void take_conversion() {
  const int16_t count = hal::adc_result();
  if (count < 0) return;
  if (channel < ready) {
    ranges[channel] = MRL_VIRTUAL ? virtual_robot::range_cm(channel) : range_cm(static_cast<uint16_t>(count));
  }
  convert(static_cast<uint8_t>(channel + 1));
}

void end_turn() {
  fired++;
  if (ready < fired) ready = fired;
  convert(0);
}

}  // namespace

void begin() {
  for (uint8_t i = 0; i < COUNT; i++) ranges[i] = SONAR_INVALID;
#if MRL_BRIDGE
  trigger = wiring::pin(Parameter::pin_sonar_trigger);
  power = wiring::pin(Parameter::pin_sonar_power);
#endif
  set(trigger, false);
  set(power, true);
  go(Step::warm_up);
}

#if MRL_BRIDGE
void end() {
  for (uint8_t i = 0; i < COUNT; i++) ranges[i] = SONAR_INVALID;
  release(trigger);
  release(power);
  step = Step::off;
}
#endif

void service() {
  switch (step) {
    case Step::warm_up:
      if (board_clock::passed(since, WARM_UP)) start_chain();
      break;
    case Step::trigger:
      if (!board_clock::passed(since, TRIGGER)) break;
      set(trigger, false);
      go(Step::ranging);
      break;
    case Step::ranging:
      if (board_clock::passed(since, READING) &&
          !(MRL_BRIDGE && (battery::converting() || ranges::converting()))) {
        end_turn();
      }
      break;
    case Step::converting:
      if (!answers::reading()) take_conversion();  // the curve takes 0.1 ms
      break;
    case Step::off: break;
  }
}

bool converting() { return step == Step::converting; }
#endif

}  // namespace sonar
}  // namespace mrl
