// Driver board of TraxBot and StingBot: OMNI-3MD motor board on I2C, sonars or environment sensors, USB serial.
// Board "Arduino Uno".  See PROTOCOL.md for the protocol, build.h for the build options, pins.h for the wiring.
#include "board.h"

void setup() { mrl::board::begin(); }

void loop() { mrl::board::run(); }
