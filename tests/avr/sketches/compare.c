/* Timer 1 at 15625 Hz: after `go`, the counter starts at `start` and the compare value `compare` is written once more. */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint16_t start = 0, compare = 0, counted = 0, word = 0;
volatile uint8_t go = 0, control = 0, matches = 0, flags = 0;

ISR(TIMER1_COMPA_vect, ISR_NAKED) {
    asm volatile("sbi %0, 5 \n reti" ::"I"(_SFR_IO_ADDR(PINB)));
}

int main(void) {
    DDRB = _BV(5);
    while (!go)
        ;
    TCCR1B = control;
    TCNT1 = start;
    PINB = _BV(5);
    OCR1A = compare;
    counted = TCNT1;
    TIFR1 = 0xFF;
    TIMSK1 = _BV(OCIE1A);
    sei();
    for (;;) {
        flags = TIFR1;
        cli();
        word = TCNT1;
        sei();
    }
}
