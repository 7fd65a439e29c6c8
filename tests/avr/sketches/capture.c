/* Timer 1 captures the edges of D8 (ICP1), falling first. */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint16_t captured[8];
volatile uint8_t count = 0;

ISR(TIMER1_CAPT_vect) {
    captured[count++ & 7] = ICR1;
    TCCR1B ^= _BV(ICES1);
    TIFR1 = _BV(ICF1);
}

int main(void) {
    TCCR1B = _BV(CS11); /* 2 MHz */
    TIFR1 = _BV(ICF1);
    TIMSK1 = _BV(ICIE1);
    sei();
    for (;;)
        ;
}
