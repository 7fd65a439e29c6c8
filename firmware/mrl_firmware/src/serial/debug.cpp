#include "debug.h"

#include "../hal/flash.h"
#include "frame_writer.h"

namespace mrl {
namespace debug {
namespace {

#define COMMAND_TEXT(code, constant, name, ...) const char COMMAND_##code[] PROGMEM = #name;
MRL_COMMANDS(COMMAND_TEXT, COMMAND_TEXT, COMMAND_TEXT)
#define COMMAND_NAME(code, ...) COMMAND_##code,
const char* const COMMAND_NAMES[] PROGMEM = {MRL_COMMANDS(COMMAND_NAME, COMMAND_NAME, COMMAND_NAME)};
#define REASON_TEXT(name) const char REASON_##name[] PROGMEM = #name;
MRL_REASONS(REASON_TEXT)
#define REASON_NAME(name) REASON_##name,
const char* const REASON_NAMES[] PROGMEM = {MRL_REASONS(REASON_NAME)};

const char INFO[] PROGMEM = "[INFO] ";
const char ERROR[] PROGMEM = "[ERROR] ";

bool on;

}  // namespace

void accepted(uint8_t code) {
  if (on) writer::text_line(INFO, flash_pointer(&COMMAND_NAMES[code - 1]));
}

void refused(Reason reason) {
  if (on) writer::text_line(ERROR, flash_pointer(&REASON_NAMES[static_cast<uint8_t>(reason)]));
}

void report() { writer::add(on); }

}  // namespace debug

namespace handlers {

void set_debug(const int16_t* args, uint8_t) { debug::on = args[0]; }

}  // namespace handlers
}  // namespace mrl
