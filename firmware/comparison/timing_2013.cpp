// A sketch of ours that has what the time of `@6e` depends on in the 2013 firmware: 115200 baud, a loop that reads one
// byte in each pass, a buffer of 32 bytes for a frame, `atoi`, `Serial.print`, and a transfer of the I2C bus for each
// counter.  It answers `@6e` alone, and is not for robots.
#include <stdlib.h>

#include "motor_board.h"

namespace {

constexpr int READ_ENCODERS = 6;
constexpr uint8_t FRAME_BYTES = 32;

char frame[FRAME_BYTES];
uint8_t length;
bool in_frame;

void reply() {
  const int16_t right = motor_board::value(motor_board::RIGHT);
  const int16_t left = motor_board::value(motor_board::LEFT);
  Serial.print('@');
  Serial.print(READ_ENCODERS);
  Serial.print(',');
  Serial.print(right);
  Serial.print(',');
  Serial.print(left);
  Serial.println('e');
}

void parse(char byte) {
  if (byte == '@') {
    in_frame = true;
    length = 0;
  } else if (in_frame && byte == 'e') {
    in_frame = false;
    frame[length] = '\0';
    if (atoi(frame) == READ_ENCODERS) {
      reply();
    }
  } else if (in_frame && length < FRAME_BYTES - 1) {
    frame[length++] = byte;
  } else {
    in_frame = false;
  }
}

}  // namespace

void setup() {
  Serial.begin(115200);
  Wire.begin();
}

void loop() {
  if (Serial.available() > 0) {
    parse(static_cast<char>(Serial.read()));
  }
}
