#include "hal_bridge_pc.h"

#include <stdlib.h>

#include <algorithm>
#include <deque>
#include <map>

#include "build.h"
#include "src/board/wiring_check.h"
#include "src/hal/chip.h"
#include "src/hal/hal.h"
#include "src/motors/quadrature.h"
#include "src/virtual/virtual_robot.h"

namespace {

using namespace mrl;

constexpr double TICK_US = 64, MISSED_KICK_US = 128000, PULSE_US = 20000;
constexpr int ENCODERS = hal::MOTORS, PINS = hal::BRIDGE_PINS;
constexpr int NO_PIN = -1;

struct Edge {
  double time_us;
  int pin, level;
};

const PcWorld* world;
double start_us, now_us, kicked_us, sample_us;
uint16_t first_tick;
bool missed, acted, single, is_new, news;
hal::Wires wires;
bool begun;
uint8_t pwm_roles;

std::deque<Edge> planned;
std::map<int, int> levels;  // of the lines that had an edge
uint8_t states[ENCODERS], edges_left[ENCODERS];
bool masked[ENCODERS];
uint16_t counts[ENCODERS], edge_ticks[ENCODERS], impossible;
hal::EncoderSample newest;
uint8_t duties[ENCODERS][PINS];
hal::PwmRate rate;
uint16_t pulses[hal::SERVOS];
double pulse_us;  // time of the next pulses

// On the chip another index reads and writes other memory.
int checked(int index) {
  if (index >= ENCODERS) abort();
  return index;
}

uint16_t tick_at(double time_us) {
  return static_cast<uint16_t>(first_tick + static_cast<uint64_t>((time_us - start_us) / TICK_US));
}

void show(int motor) {
  const uint8_t* const own = duties[motor];
#if MRL_VIRTUAL
  virtual_robot::drive(static_cast<uint8_t>(motor), duties[motor]);
#endif
  if (world->bridge) world->bridge(motor, own[0], own[1], own[2], own[3], now_us);
}

int channel_of(const Edge& edge, int encoder) {
  if (!begun) return NO_PIN;
  return edge.pin == wires.encoder[encoder][0] ? 0 : edge.pin == wires.encoder[encoder][1] ? 1 : NO_PIN;
}

uint8_t with_level(uint8_t state, int channel, int level) {
  const int bit = channel ? 1 : 2;
  return static_cast<uint8_t>(level ? state | bit : state & ~bit);
}

bool is_single(int encoder) { return single || wires.encoder[encoder][1] == NO_PIN; }

// Channel B gives the direction of an edge, but its own edges do not interrupt.
bool is_directed(int encoder) {
  const chip::Functions b = chip::functions(wires.encoder[encoder][1]);
  return b.external < 0 && b.change < 0;
}

int8_t step_of(int encoder, uint8_t index) {
  if (is_single(encoder)) return quadrature::single_step(index);
  return is_directed(encoder) ? quadrature::directed_step(index) : quadrature::step(index);
}

void count(int encoder, uint8_t state, uint16_t tick) {
  const uint8_t index = static_cast<uint8_t>(states[encoder] << 2 | state);
  const int8_t step = step_of(encoder, index);
  states[encoder] = state;
  if (!step) return;
  if (step == quadrature::IMPOSSIBLE) {
    if (impossible != UINT16_MAX) impossible++;
    return;
  }
  counts[encoder] = static_cast<uint16_t>(counts[encoder] + step);
  edge_ticks[encoder] = tick;
}

// The chip's interrupt is not called for a channel B that does not interrupt, nor for a masked encoder.
void arrive_at(int encoder, int channel, const Edge& edge) {
  const uint8_t state = with_level(states[encoder], channel, edge.level);
  if (masked[encoder] || (channel && (single || is_directed(encoder)))) {
    states[encoder] = state;
    return;
  }
  if (!--edges_left[encoder]) masked[encoder] = news = true;
  count(encoder, state, tick_at(edge.time_us));
}

void arrive(const Edge& edge) {
  levels[edge.pin] = edge.level;
  for (int encoder = 0; encoder < ENCODERS; encoder++) {
    const int channel = channel_of(edge, encoder);
    if (channel != NO_PIN) arrive_at(encoder, channel, edge);
  }
}

void take_sample() {
  for (int i = 0; i < ENCODERS && !MRL_VIRTUAL; i++) {
    newest.count[i] = counts[i];
    newest.edge_tick[i] = edge_ticks[i];
    edges_left[i] = hal::MOST_EDGES;
  }
  newest.tick = tick_at(sample_us);
  sample_us += hal::SAMPLE_TICKS * TICK_US;
  is_new = news = true;
}

void send_pulses(double to_us) {
  for (; pulse_us <= to_us; pulse_us += PULSE_US) {
    for (int servo = 0; servo < hal::SERVOS; servo++) {
      if (!begun || !pulses[servo]) continue;
      world->pin(wires.servo[servo], 1, pulse_us);
      world->pin(wires.servo[servo], 0, pulse_us + pulses[servo]);
    }
  }
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
  pulse_us = time_us + PULSE_US;
  sample_us = time_us + hal::SAMPLE_TICKS * TICK_US;
  for (uint8_t& left : edges_left) left = hal::MOST_EDGES;
}

bool pass_time(double to_us) {
  for (; sample_us <= to_us; take_sample()) arrive_until(sample_us);
  arrive_until(to_us);
  send_pulses(to_us);
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

bool level(int pin) {
  if (!levels.count(pin)) levels[pin] = world->level ? world->level(pin) : 1;
  return levels[pin];
}

bool take_action() {
  const bool had = acted;
  acted = false;
  return had;
}

}  // namespace bridge_pc

namespace hal {

void bridge_begin(const Wires& to, PwmRate to_rate, uint8_t pwm) {
  bridge_end();
  wires = to;
  begun = true;
  rate = to_rate;
  pwm_roles = pwm;
  for (int encoder = 0; encoder < ENCODERS; encoder++) {
    states[encoder] = 0;
    masked[encoder] = false;
    for (int channel = 0; channel < CHANNELS; channel++) {
      const int pin = wires.encoder[encoder][channel];
      if (pin != NO_PIN) states[encoder] = with_level(states[encoder], channel, bridge_pc::level(pin));
    }
  }
}

void bridge_end() {
  bridge_off();
  begun = false;
  std::fill(pulses, pulses + SERVOS, static_cast<uint16_t>(0));
}

void servo_write(uint8_t servo, uint16_t pulse) {
  if (!begun || wires.servo[servo] == NO_PIN) return;
  acted = acted || pulses[servo] != pulse;
  pulses[servo] = pulse;
}

void write(int motor, int role, uint8_t duty) {
  uint8_t& present = duties[checked(motor)][role];
  if (!(pwm_roles >> role & 1) && duty) duty = 255;
  if (!begun || (!MRL_VIRTUAL && wires.bridge[motor][role] == NO_PIN) || missed || present == duty) return;
  acted = true;
  present = duty;
  show(motor);
}

void bridge_write(uint8_t motor, const uint8_t (&to)[BRIDGE_PINS]) {
  for (int role = BRIDGE_PINS; role--;) write(motor, role, to[role]);
}

void bridge_off() {
  for (int motor = 0; motor < ENCODERS; motor++) {
    std::fill(duties[motor], duties[motor] + PINS, static_cast<uint8_t>(0));
    show(motor);
  }
}

bool encoder_sample(EncoderSample& sample) {
  if (!is_new) return false;
  acted = true;
#if MRL_VIRTUAL
  news = !virtual_robot::step(newest);
  if (news) return false;
#endif
  is_new = false;
  sample = newest;
  return true;
}

uint16_t encoder_read(uint16_t (&now)[MOTORS]) {
#if MRL_VIRTUAL
  return virtual_robot::counts_at(ticks(), now);
#endif
  for (int i = 0; i < MOTORS; i++) now[i] = counts[i];
  return ticks();
}

uint16_t impossible_transitions() { return impossible; }
bool encoder_masked(uint8_t encoder) { return masked[checked(encoder)]; }
void encoder_unmask(uint8_t encoder) { masked[checked(encoder)] = false; }
void encoder_single_channel(bool on) { single = on; }

void bus_use(bool) { acted = true; }

}  // namespace hal

void pc_edge(int pin, int level, double time_us) { planned.push_back({time_us, pin, level}); }

// The rate of the PWM in force; 0 is the slowest.
extern "C" int pc_bridge_pwm() { return static_cast<int>(rate); }

#if MRL_VIRTUAL
// Goes on by some samples at these levels of PWM, forward or backward, of 255; writes the counts of each, left and right.
void pc_virtual_steps(int samples, int left, int right, uint16_t* out) {
  const int levels[] = {left, right};
  for (uint8_t i = 0; i < 2; i++) {
    const uint8_t level = static_cast<uint8_t>(levels[i] < 0 ? -levels[i] : levels[i]);
    virtual_robot::drive(i, {level, static_cast<uint8_t>(levels[i] > 0 ? 255 : 0), static_cast<uint8_t>(levels[i] < 0 ? 255 : 0), 255});
  }
  for (; samples; samples--) {
    while (!virtual_robot::step(newest)) continue;
    for (uint8_t i = 0; i < 2; i++) *out++ = newest.count[i];
  }
}
#endif

#if MRL_BRIDGE
int pc_wiring_check(const int8_t* pins, int bridge, int8_t* out) {
  const wiring::Finding finding = wiring::check(pins, static_cast<Bridge>(bridge));
  out[0] = static_cast<int8_t>(finding.problem);
  out[1] = finding.parameter;
  out[2] = finding.other;
  return out[0];
}
#endif
