// Driver board of TraxBot and StingBot: OMNI-3MD motor board on I2C, or an H-bridge and encoders on the Arduino's pins;
// sonars or environment sensors; USB serial.  Board "Arduino Uno", with an H-bridge also "Arduino Nano" or "Arduino Mega".
// See PROTOCOL.md for the protocol, build.h for the build options, pins.h for the wiring.
#include "src/board/board.h"

// Takes the place of the Arduino core's, which would start timers and interrupts that nothing here needs.
int main() {
  mrl::board::begin();
  for (;;) mrl::board::run();
}
