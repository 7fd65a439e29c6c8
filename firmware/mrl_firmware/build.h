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
