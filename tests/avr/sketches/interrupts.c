/* Pin change on D8 answers on D13; the main loop either spins on one-cycle instructions or sleeps. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

volatile uint8_t go = 0, asleep = 0;
volatile uint8_t order[8], order_count = 0, hold = 0;

ISR(PCINT0_vect, ISR_NAKED) {
    asm volatile("sbi %0, 5 \n reti" ::"I"(_SFR_IO_ADDR(PINB)));
}

ISR(TIMER2_COMPA_vect) { order[order_count++ & 7] = 'c'; }
ISR(TIMER2_OVF_vect) { order[order_count++ & 7] = 'o'; }
ISR(TIMER1_COMPA_vect) { order[order_count++ & 7] = '1'; }

int main(void) {
    while (!go)
        ;
    DDRB = _BV(5);
    PCMSK0 = _BV(0);
    PCICR = _BV(PCIE0);
    if (hold) { /* three flags collected with interrupts off are served by vector number */
        PCICR = 0;
        OCR1A = 100;
        OCR2A = 200;
        TIMSK1 = _BV(OCIE1A);
        TIMSK2 = _BV(OCIE2A) | _BV(TOIE2);
        TCCR1B = _BV(CS10);
        TCCR2B = _BV(CS20);
        while (!(TIFR2 & _BV(TOV2)))
            ;
        TCCR1B = TCCR2B = 0;
    }
    sei();
    for (;;) {
        if (asleep)
            sleep_mode();
        asm volatile("nop\n nop\n nop\n nop\n nop\n nop\n nop\n nop\n");
    }
}
