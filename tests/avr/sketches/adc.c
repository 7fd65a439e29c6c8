/* Converts channel `channel` at prescaler 128 whenever `go` is set; `elapsed` counts cycles (timer 1). */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint8_t go = 0, channel = 0, interrupts = 0;
volatile uint16_t result = 0, elapsed = 0;

ISR(ADC_vect) { interrupts++; }

int main(void) {
    TCCR1B = _BV(CS10);
    ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
    sei();
    for (;;) {
        if (!go)
            continue;
        ADMUX = _BV(REFS0) | channel;
        uint16_t start = TCNT1;
        ADCSRA |= _BV(ADSC) | (go == 2 ? _BV(ADIE) : 0);
        while (ADCSRA & _BV(ADSC))
            ;
        elapsed = TCNT1 - start;
        result = ADC;
        go = 0;
    }
}
