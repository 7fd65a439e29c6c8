// Driver board of TraxBot and StingBot: OMNI-3MD motor board on I2C, sonars or environment sensors, USB serial.
// Board "Arduino Uno".  The protocol stands in PROTOCOL.md, the build options in build.h, the wiring in pins.h.
#include "board.h"

void setup() { mrl::board::begin(); }

void loop() { mrl::board::run(); }
