// Included first by the files that every frame passes.  Under the Arduino IDE's -Os an answer comes some 10 us later for each.
#pragma once
#ifdef __AVR__
#pragma GCC optimize("O2")
#endif
