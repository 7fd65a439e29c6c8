#include "hal_bridge_pc.h"

#include <stdlib.h>

#include <algorithm>
#include <deque>

#include "src/hal/hal.h"
#include "src/motors/quadrature.h"

namespace {

using namespace mrl;

constexpr double TICK_US = 64, MISSED_KICK_US = 128000;
constexpr int ENCODERS = 2, PINS = 3;
const int LINES[ENCODERS][2] = {{2, 4}, {8, 10}};  // channels A and B

struct Edge {
  double time_us;
  int pin, level;
};

const PcWorld* world;
double start_us, now_us, kicked_us, sample_us;
uint16_t first_tick;
bool missed, acted, single, is_new, news;

std::deque<Edge> planned;
uint8_t states[ENCODERS], edges_left[ENCODERS];
bool masked[ENCODERS];
uint16_t counts[ENCODERS], edge_ticks[ENCODERS], impossible;
hal::EncoderSample newest;
uint8_t duties[ENCODERS][PINS];
hal::PwmRate rate;

// On the chip another index reads and writes other memory.
int checked(int index) {
  if (index >= ENCODERS) abort();
  return index;
}

uint16_t tick_at(double time_us) {
  return static_cast<uint16_t>(first_tick + static_cast<uint64_t>((time_us - start_us) / TICK_US));
}

void show(int motor) {
  if (world->bridge) world->bridge(motor, duties[motor][0], duties[motor][1], duties[motor][2], now_us);
}

uint8_t state_after(const Edge& edge, int encoder) {
  const int bit = edge.pin == LINES[encoder][0] ? 1 : 4;
  return static_cast<uint8_t>(edge.level ? states[encoder] | bit : states[encoder] & ~bit);
}

void count(int encoder, uint8_t state, uint16_t tick) {
  const uint8_t index = static_cast<uint8_t>(states[encoder] << 1 | state);
  const int8_t step = single ? quadrature::single_step(index) : quadrature::step(index);
  states[encoder] = state;
  if (!step) return;
  if (step == quadrature::IMPOSSIBLE) {
    if (impossible != UINT16_MAX) impossible++;
    return;
  }
  counts[encoder] = static_cast<uint16_t>(counts[encoder] + step);
  edge_ticks[encoder] = tick;
}

// The chip's interrupt is not called for channel B of an encoder of one channel, nor for a masked encoder.
void arrive(const Edge& edge) {
  const int encoder = edge.pin == LINES[0][0] || edge.pin == LINES[0][1] ? 0 : 1;
  const uint8_t state = state_after(edge, encoder);
  if (masked[encoder] || (single && edge.pin == LINES[encoder][1])) {
    states[encoder] = state;
    return;
  }
  if (!--edges_left[encoder]) masked[encoder] = news = true;
  count(encoder, state, tick_at(edge.time_us));
}

void take_sample() {
  for (int i = 0; i < ENCODERS; i++) {
    newest.count[i] = counts[i];
    newest.edge_tick[i] = edge_ticks[i];
    edges_left[i] = hal::MOST_EDGES;
  }
  newest.tick = tick_at(sample_us);
  sample_us += hal::SAMPLE_TICKS * TICK_US;
  is_new = news = true;
}

void arrive_until(double time_us) {
  for (; !planned.empty() && planned.front().time_us <= time_us; planned.pop_front()) arrive(planned.front());
}

}  // namespace

namespace bridge_pc {

void begin(const PcWorld& outside, double time_us, uint16_t tick) {
  world = &outside;
  start_us = now_us = kicked_us = time_us;
  first_tick = tick;
  sample_us = time_us + hal::SAMPLE_TICKS * TICK_US;
  for (int i = 0; i < ENCODERS; i++) {
    edges_left[i] = hal::MOST_EDGES;
    for (int channel = 0; channel < 2; channel++)
      if (world->level && world->level(LINES[i][channel])) states[i] |= static_cast<uint8_t>(channel ? 4 : 1);
  }
}

bool pass_time(double to_us) {
  for (; sample_us <= to_us; take_sample()) arrive_until(sample_us);
  arrive_until(to_us);
  if (!missed && to_us - kicked_us >= MISSED_KICK_US) {
    missed = true;
    now_us = kicked_us + MISSED_KICK_US;
    hal::bridge_off();
  }
  now_us = to_us;
  const bool had = news;
  news = false;
  return had;
}

void kick(double time_us) {
  kicked_us = time_us;
  missed = false;
}

bool take_action() {
  const bool had = acted;
  acted = false;
  return had;
}

}  // namespace bridge_pc

namespace hal {

void bridge_begin(PwmRate to) {
  rate = to;
  bridge_off();
}

void bridge_write(uint8_t motor, BridgePin pin, uint8_t duty) {
  uint8_t& present = duties[checked(motor)][static_cast<int>(pin)];
  if (pin == BridgePin::logic && duty) duty = 255;
  if (missed || present == duty) return;
  acted = true;
  present = duty;
  show(motor);
}

void bridge_off() {
  for (int motor = 0; motor < ENCODERS; motor++) {
    std::fill(duties[motor], duties[motor] + PINS, static_cast<uint8_t>(0));
    show(motor);
  }
}

bool encoder_sample(EncoderSample& sample) {
  if (!is_new) return false;
  is_new = false;
  acted = true;
  sample = newest;
  return true;
}

void encoder_read(EncoderSample& sample) {
  for (int i = 0; i < ENCODERS; i++) {
    sample.count[i] = counts[i];
    sample.edge_tick[i] = edge_ticks[i];
  }
  sample.tick = ticks();
}

uint16_t impossible_transitions() { return impossible; }
bool encoder_masked(uint8_t encoder) { return masked[checked(encoder)]; }
void encoder_unmask(uint8_t encoder) { masked[checked(encoder)] = false; }
void encoder_single_channel(bool on) { single = on; }

}  // namespace hal

void pc_edge(int pin, int level, double time_us) { planned.push_back({time_us, pin, level}); }

// The rate of the PWM in force; 0 is the slowest.
extern "C" int pc_bridge_pwm() { return static_cast<int>(rate); }
