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

// 1: motors on an H-bridge and encoders on the Arduino's pins instead of the OMNI-3MD; Uno, Nano or Mega.
#ifndef MRL_BRIDGE
#define MRL_BRIDGE 0
#endif

// 1: no motors and no sensors: the board calculates a robot with an H-bridge, which drives in a room; Uno, Nano or Mega.
#ifndef MRL_VIRTUAL
#define MRL_VIRTUAL 0
#endif

// 1 on an Arduino Mega 2560, 0 on an Uno or Nano: the compiler says so.
#ifndef MRL_MEGA
#ifdef __AVR_ATmega2560__
#define MRL_MEGA 1
#else
#define MRL_MEGA 0
#endif
#endif

#if MRL_VIRTUAL && !MRL_BRIDGE
#error "a virtual robot has motors on an H-bridge: set MRL_BRIDGE to 1"
#undef MRL_VIRTUAL
#define MRL_VIRTUAL 0
#endif

#if MRL_MEGA && !MRL_BRIDGE
#error "an Arduino Mega has motors on an H-bridge: set MRL_BRIDGE to 1"
#undef MRL_MEGA
#define MRL_MEGA 0
#endif

#if MRL_BRIDGE && (MRL_ENVIRONMENT || MRL_XBEE)
#error "MRL_BRIDGE uses the pins and timers of MRL_ENVIRONMENT and MRL_XBEE: set only one of the three to 1"
// One error is enough.
#undef MRL_BRIDGE
#define MRL_BRIDGE 0
#endif
