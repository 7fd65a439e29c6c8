#include "hold.h"

#if MRL_XBEE

#include <string.h>

#include "../serial/answers.h"
#include "../board/board_clock.h"
#include "../board/config.h"
#include "../serial/frame_writer.h"
#include "../motors/motor.h"
#include "../serial/protocol.h"
#include "../board/status.h"
#include "xbee.h"

namespace mrl {
namespace hold {
namespace {

constexpr uint16_t UNIT = static_cast<uint16_t>(board_clock::of_ms(100) + 1);  // of parameter 26
constexpr uint8_t TEXT_SIZE = 4, LETTER = 1, NUMBER = 2;
constexpr uint8_t TO_ANSWER = 'h' - 'H';
static_assert((static_cast<uint8_t>(HoldText::hold) | TO_ANSWER) == static_cast<uint8_t>(HoldText::held) &&
                  (static_cast<uint8_t>(HoldText::free) | TO_ANSWER) == static_cast<uint8_t>(HoldText::freed),
              "an answer is the text with a small letter");

enum Flag : uint8_t { KNOWN = 1, HOLDS = 2, SILENT = 4, WAITS = 8 };  // waits for an answer

// A radio that has sent a hold text.  It stays known after its hold, so that an old text cannot hold the robot again.
// After a start, one that is not known holds the robot until it counts as silent: a holder may be speaking.
struct Holder {
  uint8_t flags;
  uint8_t address[xbee::ADDRESS_SIZE];
  uint8_t answer[TEXT_SIZE];  // has the number of its last text with an effect
  uint32_t heard;
};

Holder holders[MOST_HOLDERS];
int16_t ignored;
bool told;  // the host has asked for the state
bool news;  // the state has changed since

// Whether a radio that was heard then is silent.
__attribute__((noinline)) bool silent_since(uint32_t heard) {
  return board_clock::passed(heard, static_cast<uint32_t>(config::get(Parameter::radio_hold)) * UNIT);
}

int16_t number_of(const uint8_t* text) { return static_cast<int16_t>(text[NUMBER] << 8 | text[NUMBER + 1]); }

bool is_held() {
  for (const Holder& each : holders) {
    if (each.flags & HOLDS) return true;
  }
  return false;
}

// The place of this radio, otherwise one that was never used or whose hold has ended; nullptr if all hold.
Holder* place_of(const uint8_t* address) {
  Holder* place = nullptr;
  for (Holder& each : holders) {
    if ((each.flags & KNOWN) && !memcmp(each.address, address, sizeof each.address)) return &each;
    if (!(each.flags & HOLDS) && (!place || !(each.flags & KNOWN))) place = &each;
  }
  if (place) {
    place->flags = 0;
    memcpy(place->address, address, sizeof place->address);
  }
  return place;
}

// Whether the text for these flags has an effect.  An old one has none, and the end of a hold none that never began.
bool is_good(const Holder& holder, const uint8_t* text, uint8_t flags) {
  if (!(holder.flags & KNOWN)) return flags & HOLDS;
  const int16_t newer = static_cast<int16_t>(number_of(text) - number_of(holder.answer));
  return newer > 0 || (!newer && !(flags & ~holder.flags));
}

void apply(Holder& holder, uint8_t flags) {
  if ((holder.flags ^ flags) & (HOLDS | SILENT)) news = true;
  holder.flags = flags;
  holder.heard = board_clock::now();
  if (flags & HOLDS) motor::stop(StopReason::held);
}

void serve(Holder& holder) {
  if ((holder.flags & (HOLDS | SILENT)) == HOLDS && silent_since(holder.heard)) {
    holder.flags = holder.flags & KNOWN ? holder.flags | SILENT : 0;
    news = true;
  }
  if (!(holder.flags & WAITS)) return;
  board_clock::stay_awake();
  if (xbee::send(holder.address, holder.answer, TEXT_SIZE, xbee::NO_FRAME_ID)) holder.flags &= static_cast<uint8_t>(~WAITS);
}

}  // namespace

void begin() {
  holders[0].heard = board_clock::now();
  holders[0].flags = HOLDS;
}

bool on() { return config::get(Parameter::radio_hold); }

void service() {
  for (Holder& each : holders) {
    if (!on()) each.flags = 0;
    serve(each);
  }
  if (!news || !told || !answers::can_ask()) return;
  news = false;
  answers::ask(READ_RADIO);
}

// Out of line, because the motors are compiled for speed.
__attribute__((noinline)) bool refuses() {
  if (!is_held()) return false;
  status::refuse(Reason::held);
  return true;
}

bool take(const uint8_t* address, const uint8_t* text, uint8_t size) {
  if (!on() || size != TEXT_SIZE || text[0] != HOLD_MARK) return false;
  uint8_t flags = KNOWN;
  if (text[LETTER] == static_cast<uint8_t>(HoldText::hold)) {
    flags = KNOWN | HOLDS;
  } else if (text[LETTER] != static_cast<uint8_t>(HoldText::free)) {
    return false;
  }
  Holder* holder = place_of(address);
  const bool good = holder && is_good(*holder, text, flags);
  if (!good) status::count(ignored);
  if (!holder) return true;
  if (good || !(holder->flags & KNOWN)) {
    memcpy(holder->answer, text, TEXT_SIZE);
    holder->answer[LETTER] |= TO_ANSWER;
  }
  if (good) apply(*holder, flags);
  holder->flags |= KNOWN | WAITS;
  return true;
}

void tell() { news = true; }

// The address is that of a silent holder, if there is one.
void report(int16_t undelivered) {
  told = true;
  news = false;
  uint8_t flags = 0, count = 0;
  HoldState state = on() ? HoldState::free : HoldState::off;
  uint8_t nobody[xbee::ADDRESS_SIZE] = {};
  const uint8_t* address = nobody;
  for (const Holder& each : holders) {
    if (!(each.flags & HOLDS)) continue;
    if (!(each.flags & KNOWN)) {
      state = HoldState::listening;
      continue;
    }
    count++;
    if (!(flags & SILENT)) address = each.address;
    flags |= each.flags;
  }
  if (count) state = flags & SILENT ? HoldState::silent : HoldState::held;
  writer::add(static_cast<int16_t>(state));
  writer::add(count);
  writer::add(ignored);
  writer::add(undelivered);
  xbee::report_address(address);
}

}  // namespace hold

namespace handlers {

void release_hold(const int16_t*, uint8_t) {
  for (hold::Holder& each : hold::holders) {
    if (each.flags & hold::SILENT) each.flags = 0;
  }
  hold::tell();
  answers::ask(RELEASE_HOLD, hold::is_held());
}

}  // namespace handlers
}  // namespace mrl

#endif
