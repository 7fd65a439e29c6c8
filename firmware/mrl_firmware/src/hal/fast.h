// Included first by the files that every frame passes.  The -Os of the Arduino IDE makes answers slower by up to 30 us.
// With an H-bridge, whose counts need no transfer, there is time enough, and on an Uno more code than flash.
#pragma once
#include "../../build.h"

#if defined(__AVR__) && (!MRL_BRIDGE || MRL_MEGA)
#pragma GCC optimize("O2")
#endif
