#include "../hal/fast.h"
#include "frame_writer.h"

#include "crc.h"
#include "../hal/flash.h"
#include "../hal/hal.h"
#include "protocol.h"

namespace mrl {
namespace writer {
namespace {

constexpr uint8_t NUMBER_BYTES = 7;  // ",-32768"
constexpr uint8_t END_BYTES = NUMBER_BYTES + 3;
static_assert(hal::SERIAL_OUT_SIZE >= END_BYTES, "a frame's end goes out in one piece");

const uint16_t POWERS[] PROGMEM = {10000, 1000, 100, 10};

enum class Step : uint8_t { idle, open, closed };

int16_t values[MAX_ARGUMENTS];
uint16_t crc;
uint16_t next_sequence;
uint8_t count, sent;
Step step;
bool check_on;
bool frame_checked;
bool comma_out;

void put(uint8_t byte) {
  if (frame_checked) crc = crc_update(crc, byte);
  hal::serial_write(byte);
}

void put_number(int16_t value) {
  uint16_t rest = static_cast<uint16_t>(value);
  if (value < 0) {
    put('-');
    rest = static_cast<uint16_t>(0u - rest);
  }
  bool started = false;
  for (uint8_t i = 0; i < 4; i++) {
    const uint16_t power = flash_uint16(&POWERS[i]);
    uint8_t digit = '0';
    for (; rest >= power; rest = static_cast<uint16_t>(rest - power)) digit++;
    started = started || digit != '0';
    if (started) put(digit);
  }
  put(static_cast<uint8_t>('0' + rest));
}

void put_value(int16_t value) {
  if (!comma_out) put(',');
  comma_out = false;
  put_number(value);
}

void put_end() {
  if (frame_checked) put_value(static_cast<int16_t>(crc));
  hal::serial_write('e');
  hal::serial_write('\r');
  hal::serial_write('\n');
}

uint8_t text_length(const char* text) {
  uint8_t length = 0;
  while (flash_char(text + length)) length++;
  return length;
}

void put_text(const char* text) {
  for (char c; (c = flash_char(text)); text++) hal::serial_write(static_cast<uint8_t>(c));
}

}  // namespace

void set_checked(bool on) { check_on = on; }

bool idle() { return step == Step::idle && hal::serial_room() >= END_BYTES; }

void begin(uint8_t code) {
  frame_checked = check_on;
  crc = CRC_START;
  count = sent = 0;
  comma_out = false;
  step = Step::open;
  put('@');
  put_number(code);
}

void begin_early(uint8_t code) {
  begin(code);
  put(',');
  comma_out = true;
}

void add(int16_t value) {
  if (count < MAX_ARGUMENTS) values[count++] = value;
}

void stamp(uint16_t tick) {
  if (!frame_checked) return;
  add(static_cast<int16_t>(next_sequence++));
  add(static_cast<int16_t>(tick));
}

void end() {
  step = Step::closed;
  if (!hal::serial_received()) service();
}

void abandon() { step = Step::idle; }

// A number takes 40 us.  Those behind the first one wait for bytes of the host, which may be a stop; so does the first one
// in the pass that has filled the frame.
void service() {
  if (step == Step::idle) return;
  while (sent < count && hal::serial_room() >= NUMBER_BYTES) {
    put_value(values[sent++]);
    if (hal::serial_received()) return;
  }
  if (step != Step::closed || sent < count || hal::serial_room() < END_BYTES) return;
  put_end();
  step = Step::idle;
}

void text_line(const char* first, const char* second) {
  if (step != Step::idle || hal::serial_room() < text_length(first) + text_length(second) + 2) return;
  put_text(first);
  put_text(second);
  hal::serial_write('\r');
  hal::serial_write('\n');
}

}  // namespace writer
}  // namespace mrl
