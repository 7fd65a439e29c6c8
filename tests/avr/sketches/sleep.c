/* Executes SLEEP again and again with `mode` in SMCR, once `mode` is set; the overflow of timer 2 wakes it each 16.4 ms. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

volatile uint8_t mode = 0, pending = 0, wakes = 0;

EMPTY_INTERRUPT(TIMER2_OVF_vect)
EMPTY_INTERRUPT(PCINT0_vect)

int main(void) {
    while (!mode)
        ;
    TCCR2B = _BV(CS22) | _BV(CS21) | _BV(CS20); /* 15625 Hz */
    TIMSK2 = _BV(TOIE2);
    SMCR = mode;
    if (pending) { /* a pin change collected with interrupts off */
        DDRB = PCMSK0 = _BV(0);
        PCICR = _BV(PCIE0);
        PINB = _BV(0);
    }
    sei();
    for (;;) {
        sleep_cpu();
        wakes++;
    }
}
