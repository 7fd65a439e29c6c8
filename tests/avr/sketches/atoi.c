/* What a board of 2013 makes of the text of a number. */
#include <stdint.h>
#include <stdlib.h>

char text[8];
volatile int16_t number;

int main(void) {
  for (;;) number = atoi(text);
}
