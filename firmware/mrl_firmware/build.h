// Build options for different boards.  The Arduino IDE has no compiler options: change the 0 to 1 here.
#pragma once

// 1: environment sensors (alcohol, dust, light, thermopile, compass) instead of sonars.
#ifndef MRL_ENVIRONMENT
#define MRL_ENVIRONMENT 0
#endif

// 1: an XBee on a software serial port.
#ifndef MRL_XBEE
#define MRL_XBEE 0
#endif

// 1: motors on an H-bridge and encoders on the Arduino's pins instead of the OMNI-3MD; Uno or Nano.
#ifndef MRL_BRIDGE
#define MRL_BRIDGE 0
#endif

#if MRL_BRIDGE && (MRL_ENVIRONMENT || MRL_XBEE)
#error "MRL_BRIDGE uses the pins and timers of MRL_ENVIRONMENT and MRL_XBEE: set only one of the three to 1"
// One error is enough.
#undef MRL_BRIDGE
#define MRL_BRIDGE 0
#endif
