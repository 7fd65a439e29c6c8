// Included first by the files that every frame passes.  The -Os of the Arduino IDE makes answers slower by up to 30 us.
#pragma once
#ifdef __AVR__
#pragma GCC optimize("O2")
#endif
