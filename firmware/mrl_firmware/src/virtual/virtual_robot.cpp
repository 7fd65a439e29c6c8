#include "../../build.h"

#if MRL_VIRTUAL

#include "virtual_robot.h"

#include "../board/config.h"
#include "../sensors/battery.h"
#include "../serial/frame_writer.h"
#include "../serial/protocol.h"

namespace mrl {
namespace virtual_robot {
namespace {

// Of the emulator's gearmotor at 12 V: it approaches its speed with 1 / 14.85 s, of which a period of 4.992 ms is worth
// 7.144 %, and its mean speed meanwhile is still 96.38 % of the speed before.  Friction costs 5.8 % of the full speed; to
// start costs half as much again.
constexpr int32_t APPROACH_Q16 = 4682, LAG_Q16 = 63164;
constexpr int32_t FRICTION_Q16 = 3781, DRIVEN_Q16 = 65536 + 2850;  // of the full speed; without friction at 12 V
constexpr int32_t MOST_Q16 = 200L << 16;                           // counts a period
constexpr int16_t FULL_CV = 1260, EMPTY_CV = 960, NOMINAL_CV = 1200, SAGGED_CV = 900;  // 0.01 V
// Three cells of 2.6 Ah fall by 3 V; a motor takes 1.2 A at stall, and the pack loses 0.1 V/A, all as assumed there.
constexpr int16_t STALL_MA = 1200, IDLE_MA = 100;
constexpr int32_t MA_PERIODS_PER_CV = 6250000;  // 2.6 Ah / 300 / 4.992 ms

constexpr uint8_t SIDES = 2, SONARS = 3;
constexpr int16_t ROOM_X = 4000, ROOM_Y = 3000;                                          // mm
constexpr int16_t BOX_LEFT = 2500, BOX_RIGHT = 2900, BOX_BOTTOM = 1900, BOX_TOP = 2300;  // mm
constexpr int16_t BODY = 130, START_X = 1000, START_Y = 1000;                            // mm
constexpr int16_t SONAR_X[SONARS] = {90, 70, 70}, SONAR_Y[SONARS] = {0, 50, -50};        // mm, as on the duo
constexpr int8_t SONAR_YAW[SONARS] = {0, 1, -1};                                         // eighths of a turn
constexpr uint32_t QUARTER = 0x40000000;                                                 // of a turn

struct Direction {
  int16_t cosine_q15, sine_q15;
};
struct Wheel {
  int32_t speed_q16;    // counts a period
  uint32_t travel_q16;  // counts; the upper half is the counter
  int32_t drive_q16;    // share of the battery's voltage, -1 to 1
  bool coasts;
  int32_t period_drive_q16;  // the same at the begin of the period: both wheels get a command in the same one
  bool period_coasts;
};
Wheel wheels[SIDES];
uint16_t not_counted[SIDES];
hal::EncoderSample newest;
int16_t moved[SIDES];         // counts, in the period before the newest sample
int32_t full_q16;             // counts a period at full speed and 12 V
int32_t supply_q16;           // the same without friction at the present voltage
uint32_t ma_per_count_q8;     // current of a motor for each count a period that it lacks
uint32_t mm_per_count_q24;
uint32_t turn_per_count_q8;   // a turn is 2^32
int32_t x_q16 = static_cast<int32_t>(START_X) << 16, y_q16 = static_cast<int32_t>(START_Y) << 16;  // mm
uint64_t heading_q24;         // a turn is 2^32
Direction facing = {INT16_MAX, 0};
int32_t drawn;                // mA periods of the present 0.01 V
int16_t rest_cv = FULL_CV, now_cv = FULL_CV;
uint8_t next_part;            // of a period
int32_t rolled_q16[SIDES];    // in this period
int32_t taken_ma;

bool has(int16_t fault) { return config::get(Parameter::virtual_faults) & fault; }

bool has(int16_t left, uint8_t motor) { return has(static_cast<int16_t>(left << motor)); }

// A product with a share of at most 2, in 32 bits.
int32_t part(int32_t value, int32_t share_q16) {
  const uint16_t low = static_cast<uint16_t>(value), share = static_cast<uint16_t>(share_q16);
  return (value >> 16) * share_q16 + static_cast<int32_t>(low) * (share_q16 >> 16) +
         static_cast<int32_t>((static_cast<uint32_t>(low) * share + 32768) >> 16);
}

int32_t size_of(int32_t value) { return value < 0 ? -value : value; }

// ---- motors

// A period of a motor; returns how far it turns [count, Q16].
int32_t move(Wheel& wheel) {
  const int32_t friction = part(full_q16, FRICTION_Q16), speed = wheel.speed_q16;
  const int32_t driven = part(supply_q16, wheel.period_drive_q16);
  if (!speed && size_of(driven) <= friction + friction / 2) return 0;
  const bool backward = speed ? speed < 0 : driven < 0;
  const int32_t end = (wheel.period_coasts ? speed : driven) + (backward ? friction : -friction);
  const int32_t next = speed + part(end - speed, APPROACH_Q16);
  if (speed && next && (next < 0) != backward) {  // friction holds it for the rest of the period
    wheel.speed_q16 = 0;
    return speed / 2;
  }
  wheel.speed_q16 = size_of(next) < MOST_Q16 ? next : backward ? -MOST_Q16 : MOST_Q16;
  return end + part(speed - end, LAG_Q16);
}

// The last edge came when the wheel was at a whole count.
void count(uint8_t motor, int32_t way, hal::EncoderSample& sample) {
  uint32_t& travel = wheels[motor].travel_q16;
  const uint16_t before = static_cast<uint16_t>(travel >> 16);
  travel += static_cast<uint32_t>(way);
  const uint16_t now = static_cast<uint16_t>(travel >> 16), moved = static_cast<uint16_t>(now - before);
  if (has(VIRTUAL_FAULT_LEFT_ENCODER_SILENT, motor)) {
    not_counted[motor] = static_cast<uint16_t>(not_counted[motor] + moved);
    return;
  }
  sample.count[motor] = static_cast<uint16_t>(now - not_counted[motor]);
  if (!moved) return;
  const uint16_t beyond = static_cast<uint16_t>(travel);
  const uint32_t since = way > 0 ? beyond : 65536 - beyond, size = static_cast<uint32_t>(size_of(way));
  sample.edge_tick[motor] = static_cast<uint16_t>(sample.tick - since * hal::SAMPLE_TICKS / size);
}

// The battery gives current while the bridge drives.
int32_t current_ma(const Wheel& wheel) {
  const int32_t lacks = supply_q16 - (wheel.period_drive_q16 < 0 ? -wheel.speed_q16 : wheel.speed_q16);
  const int32_t ma = static_cast<int32_t>(static_cast<uint32_t>(size_of(lacks) >> 8) * ma_per_count_q8 >> 16);
  return part(lacks < 0 ? -ma : ma, size_of(wheel.period_drive_q16));
}

void feed() { supply_q16 = part(part(full_q16, DRIVEN_Q16), static_cast<int32_t>(now_cv) * 65536 / NOMINAL_CV); }

void draw(int32_t ma) {
  for (drawn += ma; drawn >= MA_PERIODS_PER_CV; drawn -= MA_PERIODS_PER_CV) {
    if (rest_cv > EMPTY_CV) rest_cv--;
  }
  now_cv = static_cast<int16_t>((has(VIRTUAL_FAULT_BATTERY_SAGS) ? SAGGED_CV : rest_cv) - ma / 100);
  feed();
}

// ---- body

// The series of the sine to the 7th power, economised: it errs by less than a unit.
int16_t sine_q15(uint32_t angle) {
  const uint32_t within = angle & (QUARTER - 1);
  const int32_t z = static_cast<int32_t>((angle & QUARTER ? QUARTER - within : within) >> 15);  // of a quarter, Q15
  const int32_t square = z * z >> 15;
  int32_t sum = 2605 - (square * 143 >> 15);
  sum = 21166 - (square * sum >> 15);
  sum = 51472 - (square * sum >> 15);
  const int32_t sine = z * (sum >> 1) >> 14;
  const int16_t size = static_cast<int16_t>(sine > INT16_MAX ? INT16_MAX : sine);
  return static_cast<int16_t>(angle & 0x80000000 ? -size : size);
}

Direction direction(uint32_t angle) { return {sine_q15(angle + QUARTER), sine_q15(angle)}; }

bool is_free(int16_t x, int16_t y) {
  const bool inside = x >= BODY && x <= ROOM_X - BODY && y >= BODY && y <= ROOM_Y - BODY;
  const bool at_box = x > BOX_LEFT - BODY && x < BOX_RIGHT + BODY && y > BOX_BOTTOM - BODY && y < BOX_TOP + BODY;
  return inside && !at_box;
}

// Tyres slip where a wall or the box is in the way.
void roll(int32_t left_q16, int32_t right_q16) {
  const int64_t turn_q24 = static_cast<int64_t>(right_q16 - left_q16) * turn_per_count_q8;
  const uint64_t middle_q24 = heading_q24 + static_cast<uint64_t>(turn_q24 / 2);
  heading_q24 += static_cast<uint64_t>(turn_q24);
  facing = direction(static_cast<uint32_t>(middle_q24 >> 24));
  const int64_t both_q40 = static_cast<int64_t>(left_q16 + right_q16) * mm_per_count_q24;
  const int32_t way_q16 = static_cast<int32_t>((both_q40 + (1L << 24)) >> 25);
  const int32_t x = x_q16 + part(way_q16, 2L * facing.cosine_q15), y = y_q16 + part(way_q16, 2L * facing.sine_q15);
  if (!is_free(static_cast<int16_t>(x >> 16), static_cast<int16_t>(y >> 16))) return;
  x_q16 = x;
  y_q16 = y;
}

// ---- sonars

// Whether a ray that comes to a line meets it between two places of it.
bool meets(int16_t gap, int16_t share_q15, int16_t from, int16_t across_q15, int16_t low, int16_t high) {
  if (gap < 0 || !share_q15) return false;
  const int32_t at = static_cast<int32_t>(gap) * across_q15;
  return static_cast<int32_t>(low - from) * share_q15 <= at && at <= static_cast<int32_t>(high - from) * share_q15;
}

int16_t range_mm(int16_t gap, int16_t share_q15) {
  return static_cast<int16_t>(static_cast<int32_t>(gap) * 32768 / share_q15);
}

// To the box, or to the wall behind it; with one division.
int16_t ray(int16_t x, int16_t y, const Direction& to) {
  const int16_t c = to.cosine_q15, s = to.sine_q15;
  const int16_t size_c = static_cast<int16_t>(size_of(c)), size_s = static_cast<int16_t>(size_of(s));
  int16_t gap_x = static_cast<int16_t>(c > 0 ? BOX_LEFT - x : x - BOX_RIGHT);
  int16_t gap_y = static_cast<int16_t>(s > 0 ? BOX_BOTTOM - y : y - BOX_TOP);
  if (meets(gap_x, size_c, y, s, BOX_BOTTOM, BOX_TOP)) return range_mm(gap_x, size_c);
  if (meets(gap_y, size_s, x, c, BOX_LEFT, BOX_RIGHT)) return range_mm(gap_y, size_s);
  gap_x = static_cast<int16_t>(c > 0 ? ROOM_X - x : x);
  gap_y = static_cast<int16_t>(s > 0 ? ROOM_Y - y : y);
  const bool to_x = static_cast<int32_t>(gap_x) * size_s < static_cast<int32_t>(gap_y) * size_c;
  return to_x ? range_mm(gap_x, size_c) : range_mm(gap_y, size_s);
}

// A direction that is turned by a multiple of an eighth of a turn, -1 to 1.
Direction turned(const Direction& from, int8_t eighths) {
  if (!eighths) return from;
  const int16_t s = static_cast<int16_t>(eighths < 0 ? -from.sine_q15 : from.sine_q15);
  const int16_t c = static_cast<int16_t>(eighths < 0 ? -from.cosine_q15 : from.cosine_q15);
  const auto half = [](int32_t sum) { return static_cast<int16_t>(sum * 23170 >> 15); };  // of the root of 2
  return {half(static_cast<int32_t>(from.cosine_q15) - s), half(static_cast<int32_t>(from.sine_q15) + c)};
}

int16_t mm(int32_t q16) { return static_cast<int16_t>(q16 >> 16); }

}  // namespace

void configure() {
  const auto number = [](Parameter parameter) { return static_cast<uint64_t>(config::get(parameter)); };
  const uint64_t counts = number(Parameter::gearbox) * number(Parameter::encoder_counts);  // 0.01 a turn
  const uint64_t radius = number(Parameter::wheel_radius);
  mm_per_count_q24 = static_cast<uint32_t>(radius * 105414357 / counts);
  turn_per_count_q8 = static_cast<uint32_t>((radius * 50 << 40) / (counts * number(Parameter::axis_radius)));
  full_q16 = static_cast<int32_t>(counts * number(Parameter::full_speed) * 3573 >> 16);
  ma_per_count_q8 = full_q16 ? static_cast<uint32_t>(STALL_MA * 16777216ULL / static_cast<uint32_t>(full_q16)) : 0;
  feed();
}

// PWM brakes between the pulses.  A Mega has motors that this robot has not.
void drive(uint8_t motor, const uint8_t (&duties)[hal::BRIDGE_PINS]) {
  if (motor >= SIDES) return;
  const bool ahead = duties[1], back = duties[2], enabled = duties[3];
  Wheel& wheel = wheels[motor];
  wheel.coasts = !enabled || (!ahead && !back);
  const int32_t share = static_cast<int32_t>(duties[0]) * 257;
  wheel.drive_q16 = wheel.coasts || ahead == back ? 0 : ahead ? share : -share;
}

bool step(hal::EncoderSample& sample) {
  if (!next_part) {
    for (Wheel& wheel : wheels) {
      wheel.period_drive_q16 = wheel.drive_q16;
      wheel.period_coasts = wheel.coasts;
    }
  }
  if (next_part < SIDES) {
    const uint8_t motor = next_part++;
    const bool blocked = has(VIRTUAL_FAULT_LEFT_BLOCKED, motor);
    Wheel& wheel = wheels[motor];
    if (blocked) wheel.speed_q16 = 0;
    const int32_t moved_q16 = blocked ? 0 : move(wheel);
    taken_ma += current_ma(wheel);
    count(motor, moved_q16, sample);
    rolled_q16[motor] = has(VIRTUAL_FAULT_LEFT_SLIPS, motor) ? 0 : moved_q16;
    return false;
  }
  if (next_part == SIDES) {
    next_part++;
    roll(rolled_q16[0], rolled_q16[1]);
    return false;
  }
  draw(taken_ma + IDLE_MA);
  taken_ma = next_part = 0;
  for (uint8_t i = 0; i < SIDES; i++) moved[i] = static_cast<int16_t>(sample.count[i] - newest.count[i]);
  newest = sample;
  return true;
}

uint16_t counts_at(uint16_t tick, uint16_t (&counts)[hal::MOTORS]) {
  const uint16_t passed = static_cast<uint16_t>(tick - newest.tick);
  const int16_t since = static_cast<int16_t>(passed < 2 * hal::SAMPLE_TICKS ? passed : 2 * hal::SAMPLE_TICKS);
  for (uint8_t i = 0; i < SIDES; i++) {
    const int16_t more = static_cast<int16_t>(static_cast<int32_t>(moved[i]) * since / hal::SAMPLE_TICKS);
    counts[i] = static_cast<uint16_t>(newest.count[i] + more);
  }
  return static_cast<uint16_t>(newest.tick + since);
}

int16_t range_cm(uint8_t sonar) {
  if (has(static_cast<int16_t>(VIRTUAL_FAULT_FRONT_SONAR_DEAD << sonar))) return SONAR_INVALID;
  const int32_t forward = SONAR_X[sonar], aside = SONAR_Y[sonar];
  const int16_t x = static_cast<int16_t>(mm(x_q16) + ((forward * facing.cosine_q15 - aside * facing.sine_q15) >> 15));
  const int16_t y = static_cast<int16_t>(mm(y_q16) + ((forward * facing.sine_q15 + aside * facing.cosine_q15) >> 15));
  return static_cast<int16_t>(ray(x, y, turned(facing, SONAR_YAW[sonar])) / 10);
}

void report_pose() {
  writer::add(mm(x_q16));
  writer::add(mm(y_q16));
  const int32_t turn_q31 = static_cast<int32_t>(heading_q24 >> 24);
  writer::add(static_cast<int16_t>(static_cast<int64_t>(turn_q31) * 6283 >> 32));
}

}  // namespace virtual_robot

// That of a real robot is not in this build.
namespace battery {

void begin() {}
void service() {}
bool converting() { return false; }
bool connected() { return true; }
bool measured() { return true; }
int16_t centivolts() { return virtual_robot::now_cv; }

}  // namespace battery
}  // namespace mrl

#endif
