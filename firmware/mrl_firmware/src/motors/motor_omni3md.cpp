// The OMNI-3MD on the bus: finds it, sets it up as soon as it answers and each time it comes back, sends commands, reads
// its counters.
#include "../hal/fast.h"
#include "../../build.h"

#if !MRL_BRIDGE

#include "../board/board_clock.h"
#include "../board/config.h"
#include "../serial/frame_writer.h"
#include "../radio/hold.h"
#include "motor.h"
#include "omni3md_message.h"
#include "../board/status.h"

namespace mrl {
namespace motor {
namespace {

constexpr uint8_t ADDRESS = 0x18;
constexpr uint32_t RETRY_PRESENCE = board_clock::of_ms(48);
// A board that comes and goes (a loose wire) is set up at most once a second, because this writes its EEPROM.
constexpr uint32_t RETRY_AT_MOST = board_clock::of_ms(1000);
constexpr uint32_t STEADY = board_clock::of_ms(5000);
constexpr uint32_t POLL_PERIOD = board_clock::of_ms(40);  // shorter than the board's shortest I2C timeout, 100 ms
constexpr uint32_t POLL_OVERDUE = board_clock::of_ms(64);
constexpr uint8_t PAUSE_AFTER_FAILURE_MS = 1;
constexpr uint8_t FAILURES_ALLOWED = 4;

enum class Presence : uint8_t { absent, asking, present };
// The order of requests to a board that has appeared; the first is a stop.
enum class Ask : uint8_t { stop, version, decimals, battery, temperature, done };
// The bits of the other two prescalers follow that of the first.
enum SetUp : uint8_t {
  SET_GEOMETRY = 1, SET_GAINS = 2, SET_RAMP = 4, SET_TIMEOUT = 8, SET_PRESCALER = 16, SET_ALL = 127
};
enum class Kind : uint8_t { stop, ask, set_up, command, counts, poll };

Queue queue;
Message current;  // the command on the bus, kept for a retry
Counts last_counts;
uint32_t paused_at, last_poll, absent_since, present_since;
uint32_t retry_presence = RETRY_PRESENCE;
uint16_t pause_ticks;
int16_t version, battery, temperature;
Presence presence;
Ask ask_step;
Kind kind;
CountsState state;
uint8_t set_up_todo, set_up_now;
uint8_t prescalers[3];
uint8_t failures;
bool found, known;
bool paused, eeprom_busy;
bool stop_wanted, stop_again;
bool retry_current, drop_current;
bool poll_temperature;

// At the end of a pause, the stop that the board may have missed is sent before all waiting commands.
void end_pause() {
  paused = eeprom_busy = false;
  stop_wanted = stop_wanted || stop_again;
  stop_again = false;
}

// Uses a flag instead of comparing with a time that may be days ago, because the clock wraps.
bool pausing() {
  if (paused && board_clock::passed(paused_at, pause_ticks)) end_pause();
  return paused;
}

void pause(uint8_t ms) {
  paused = true;
  paused_at = board_clock::now();
  pause_ticks = static_cast<uint16_t>(board_clock::of_ms(ms) + 1);
}

void pause_for_eeprom(uint8_t ms) {
  if (!ms) return;
  pause(ms);
  eeprom_busy = true;
}

void fill(hal::Transfer& transfer, Kind what, const Message& message, uint8_t in_count = 0) {
  kind = what;
  transfer.address = ADDRESS;
  transfer.out_count = message.size;
  for (uint8_t i = 0; i < message.size; i++) transfer.out[i] = message.bytes[i];
  transfer.in_count = in_count;
}

void read(hal::Transfer& transfer, Kind what, uint8_t command, uint8_t count) {
  fill(transfer, what, Message(command), count);
}

int16_t word_in(uint8_t at) {
  return static_cast<int16_t>(hal::transfer.in[at] << 8 | hal::transfer.in[at + 1]);
}

// Converts the board's tenths to the protocol's hundredths.
int16_t hundredths(int16_t tenths) {
  return tenths > 3276 ? INT16_MAX : tenths < -3276 ? INT16_MIN : static_cast<int16_t>(tenths * 10);
}

// ---- presence

void start_asking() {
  presence = Presence::asking;
  ask_step = Ask::stop;
  set_up_todo = SET_ALL;
  failures = 0;
}

void back_off() {
  const bool steady = board_clock::passed(present_since, STEADY);
  retry_presence = steady ? RETRY_PRESENCE : retry_presence * 2;
  if (retry_presence > RETRY_AT_MOST) retry_presence = RETRY_AT_MOST;
}

void lose() {
  if (presence == Presence::present) {
    status::stopped(StopReason::motor_board);
    back_off();
  }
  presence = Presence::absent;
  absent_since = board_clock::now();
  known = true;
  version = battery = temperature = 0;
  stop_wanted = stop_again = retry_current = false;
  if (state == CountsState::wanted) state = CountsState::failed;
  for (uint8_t dropped = queue.clear(); dropped; dropped--) status::refuse(Reason::unavailable);
}

void ask_next(hal::Transfer& transfer) {
  if (ask_step == Ask::stop) return fill(transfer, Kind::ask, Message(STOP_MOTORS).keys());
  if (ask_step == Ask::version) return read(transfer, Kind::ask, READ_VERSION, 1);
  if (ask_step == Ask::decimals) return read(transfer, Kind::ask, READ_VERSION_DECIMALS, 1);
  read(transfer, Kind::ask, ask_step == Ask::battery ? READ_BATTERY : READ_TEMPERATURE, 2);
}

void take_answer() {
  if (ask_step == Ask::version) version = static_cast<int16_t>(hal::transfer.in[0] * 100);
  if (ask_step == Ask::decimals) version = static_cast<int16_t>(version + hal::transfer.in[0]);
  if (ask_step == Ask::battery) battery = hundredths(word_in(0));
  if (ask_step == Ask::temperature) temperature = hundredths(word_in(0));
  ask_step = static_cast<Ask>(static_cast<uint8_t>(ask_step) + 1);
  if (ask_step != Ask::done) return;
  presence = Presence::present;
  present_since = board_clock::now();
  found = known = true;
}

// ---- set-up: parameters and prescalers, in parts that are sent one by one

Message set_up_message(uint8_t part) {
  switch (part) {
    case SET_GEOMETRY:
      return Message(GEOMETRY, 20)
          .word(config::get(Parameter::axis_radius))
          .word(config::get(Parameter::wheel_radius))
          .word(config::get(Parameter::gearbox))
          .word(config::get(Parameter::encoder_counts));
    case SET_GAINS:
      return Message(GAINS, 15)
          .word(config::get(Parameter::kp))
          .word(config::get(Parameter::ki))
          .word(config::get(Parameter::kd));
    case SET_RAMP:
      return Message(RAMP, 10).word(config::get(Parameter::ramp_time)).word(config::get(Parameter::ramp_gain));
    case SET_TIMEOUT: {
      const uint8_t timeout = static_cast<uint8_t>(config::get(Parameter::motor_timeout));
      return Message(TIMEOUT, 5).byte(timeout).byte(KEY_1).byte(timeout).byte(KEY_2);
    }
    default: {
      const uint8_t index = static_cast<uint8_t>(part / (2 * SET_PRESCALER));
      return Message(PRESCALER, 10).byte(static_cast<uint8_t>(index + 1)).byte(prescalers[index]).keys();
    }
  }
}

// The part that a parameter belongs to, or 0.
uint8_t set_up_part(Parameter parameter) {
  if (parameter >= Parameter::axis_radius && parameter <= Parameter::encoder_counts) return SET_GEOMETRY;
  if (parameter >= Parameter::kp && parameter <= Parameter::kd) return SET_GAINS;
  if (parameter == Parameter::ramp_time || parameter == Parameter::ramp_gain) return SET_RAMP;
  return parameter == Parameter::motor_timeout ? SET_TIMEOUT : 0;
}

void set_up_next(hal::Transfer& transfer) {
  set_up_now = static_cast<uint8_t>(set_up_todo & -set_up_todo);
  set_up_todo &= static_cast<uint8_t>(~set_up_now);
  fill(transfer, Kind::set_up, set_up_message(set_up_now));
}

// ---- ends of transfers

void take_counts() {
  last_counts.left = word_in(0);
  last_counts.rear = word_in(2);
  last_counts.right = word_in(4);
  last_counts.tick = hal::bus_latched();
  state = CountsState::ready;
}

void take_poll() {
  (poll_temperature ? temperature : battery) = hundredths(word_in(0));
  poll_temperature = !poll_temperature;
}

void succeed() {
  failures = 0;
  if (kind == Kind::ask) take_answer();
  if (kind == Kind::set_up) pause_for_eeprom(set_up_message(set_up_now).pause_ms);
  if (kind == Kind::counts) take_counts();
  if (kind == Kind::poll) take_poll();
  if (presence == Presence::present) status::set_fault(FAULT_MOTOR_BOARD, false);
}

void fail(bus::Result result) {
  const bool hung = result == bus::Result::hung;
  if (kind == Kind::stop && !hung && eeprom_busy) return;  // it is busy, not gone
  if (kind == Kind::stop) stop_wanted = true;
  status::set_fault(FAULT_MOTOR_BOARD, true);
  if (kind == Kind::counts || (hung && state == CountsState::wanted)) state = CountsState::failed;
  if (kind == Kind::set_up) set_up_todo |= set_up_now;
  if (kind == Kind::command && !drop_current) retry_current = true;
  failures = static_cast<uint8_t>(failures + (hung ? 2 : 1));
  if (kind == Kind::ask || failures >= FAILURES_ALLOWED) return lose();
  pause(PAUSE_AFTER_FAILURE_MS);
}

void command_next(hal::Transfer& transfer) {
  if (!retry_current) {
    current = queue.front();
    queue.pop();
  }
  retry_current = drop_current = false;
  fill(transfer, Kind::command, current);
}

// While the board writes its EEPROM, it may miss or refuse a stop; the stop is repeated at the end of the pause.
bool next_stop(hal::Transfer& transfer) {
  if (!stop_wanted) return false;
  stop_wanted = false;
  stop_again = eeprom_busy;
  fill(transfer, Kind::stop, Message(STOP_MOTORS).keys());
  return true;
}

// Queues a command, unless it is a move and the radio holds the robot; false if the board is not available, or after its
// own stop.
bool send(const Message& message) {
  const bool turns = message.turns_motors(), there = available();
  if (turns && there && hold::refuses()) return true;
  if ((turns && status::refuses_move()) || !there) return false;
  if (!queue.push(message)) status::refuse(Reason::unavailable);
  if (turns) status::turned();
  return true;
}

}  // namespace

void begin() { start_asking(); }

void service() {
  if (presence == Presence::absent && board_clock::passed(absent_since, retry_presence)) start_asking();
  pausing();
}

bool available() { return presence != Presence::absent; }
bool asked() { return known; }
bool ever_found() { return found; }

void stop(StopReason reason) {
  status::stopped(reason);
  queue.drop_moves();
  drop_current = current.turns_motors();
  if (drop_current) retry_current = false;
  if (presence == Presence::absent) return start_asking();
  stop_wanted = true;
}

bool move_twist(int16_t linear, int16_t, int16_t angular) { return send(Message(MOVE_SI).word(linear).word(angular)); }

bool move_percent(int16_t left, int16_t right, bool controlled) {
  return send(Message(controlled ? MOVE_PID : MOVE_PLAIN).word(left).word(0).word(right));
}

bool move_position(uint8_t motor, int16_t speed, int16_t position) {
  return send(Message(MOVE_POSITION).byte(motor).word(speed).word(position).byte(1));
}

bool move_omni(uint8_t speed, int16_t rotation, int16_t direction) {
  return send(Message(MOVE_OMNI).byte(speed).word(rotation).word(direction));
}

bool calibrate() { return send(Message(CALIBRATE_MOTORS).byte(1).byte(1).byte(1).keys()); }

bool set_prescaler(uint8_t encoder, uint8_t value) {
  const uint8_t index = static_cast<uint8_t>(encoder - 1);
  if (prescalers[index] != value) set_up_todo = static_cast<uint8_t>(set_up_todo | SET_PRESCALER << index);
  prescalers[index] = value;
  return true;
}

bool preset_encoder(uint8_t encoder, int16_t count) { return send(Message(PRESET).byte(encoder).word(count).keys()); }

bool reset_encoders() {
  bool all = true;
  for (uint8_t encoder = 1; encoder <= 3; encoder++) all = preset_encoder(encoder, 0) && all;
  return all;
}

void refresh(Parameter parameter) {
  set_up_todo = static_cast<uint8_t>(set_up_todo | set_up_part(parameter));
}

void refresh_all() { set_up_todo = SET_ALL; }

void want_counts() { state = available() ? CountsState::wanted : CountsState::failed; }

CountsState counts_state() { return state; }
const Counts& counts() { return last_counts; }

int16_t capabilities() { return CAPABILITY_OMNI; }

void report_info() {
  writer::add(temperature);
  writer::add(version);
  writer::add(battery);
  writer::add(PROTOCOL_VERSION);
  writer::add(config::get(Parameter::robot_id));
}

void report_status() {}

bool has_work() {
  return stop_wanted || retry_current || set_up_todo || presence == Presence::asking ||
         state == CountsState::wanted || !queue.empty();
}

bool next_transfer(hal::Transfer& transfer) {
  if (presence == Presence::absent) return false;
  const bool wait = pausing();
  if (next_stop(transfer)) return true;
  if (wait) return false;
  if (presence == Presence::asking) {
    ask_next(transfer);
  } else if (set_up_todo) {
    set_up_next(transfer);
  } else if (retry_current || !queue.empty()) {
    command_next(transfer);
  } else if (state == CountsState::wanted) {
    state = CountsState::reading;
    read(transfer, Kind::counts, READ_ENCODERS_FROM_1, 6);
  } else {
    return false;
  }
  return true;
}

bool next_poll(hal::Transfer& transfer, bool only_overdue) {
  if (presence != Presence::present || pausing()) return false;
  if (!board_clock::passed(last_poll, only_overdue ? POLL_OVERDUE : POLL_PERIOD)) return false;
  last_poll = board_clock::now();
  read(transfer, Kind::poll, poll_temperature ? READ_TEMPERATURE : READ_BATTERY, 2);
  return true;
}

void transfer_ended(bus::Result result) {
  if (result == bus::Result::done) {
    succeed();
  } else {
    fail(result);
  }
}

}  // namespace motor
}  // namespace mrl

#endif
