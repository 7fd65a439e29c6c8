#include "../hal/fast.h"
#include "commands.h"

#include "answers.h"
#include "../board/board_clock.h"
#include "debug.h"
#include "../board/failsafe.h"
#include "../hal/flash.h"
#include "../hal/hal.h"
#include "protocol.h"
#include "rows.h"
#include "../board/status.h"

namespace mrl {
namespace commands {
namespace {

typedef void Handler(const int16_t* args, uint8_t count);

void ask(const int16_t*, uint8_t) { answers::ask(decoder.code()); }
void unavailable(const int16_t*, uint8_t) { status::refuse(Reason::unavailable); }

#define HANDLER(code, constant, name, there, ...) (there) ? handlers::name : unavailable,
#define QUERY(code, constant, name, there, ...) (there) ? ask : unavailable,
#define NO_HANDLER(...) nullptr,
Handler* const HANDLERS[] PROGMEM = {MRL_COMMANDS(HANDLER, QUERY, NO_HANDLER)};

// At 1000000 baud, bytes arrive as fast as they are decoded.  Without a limit, a flood of bytes would delay everything
// else, including a requested stop and the watchdog.
constexpr uint8_t BYTES_A_PASS = 16;

void execute() {
  const uint8_t code = decoder.code();
  failsafe::valid_frame();
  if (rows::is_answered(code) && !answers::can_ask()) return status::refuse(Reason::overrun);
  flash_pointer(&HANDLERS[code - 1])(decoder.arguments(), decoder.count());
  debug::accepted(code);
}

// Out of line, so that a look at an empty line stays short.
__attribute__((noinline)) void take_bytes() {
  for (uint8_t left = BYTES_A_PASS; left; left--) {
    const int16_t byte = hal::serial_read();
    if (byte < 0) return;
    const Verdict verdict = decoder.feed(static_cast<uint8_t>(byte));
    if (verdict == Verdict::frame) execute();
    if (verdict == Verdict::garbage) status::refuse(decoder.reason());
    if (verdict != Verdict::none) board_clock::stay_awake();
  }
}

}  // namespace

FrameDecoder decoder;

// Each pass of the loop looks several times: this has the look in line.
__attribute__((flatten)) void receive() {
  if (hal::serial_received()) take_bytes();
}

void discard() {
  hal::serial_discard();
  decoder.clear();
}

}  // namespace commands
}  // namespace mrl
