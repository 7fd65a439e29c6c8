/* START by interrupt: counts TWI interrupts, the vector clears TWINT only when `handle` is set. */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint8_t go = 0, handle = 1;
volatile uint16_t interrupts = 0;
volatile uint32_t passes = 0;

ISR(TWI_vect) {
    interrupts++;
    if (handle)
        TWCR = _BV(TWINT) | _BV(TWSTO) | _BV(TWEN) | _BV(TWIE);
}

int main(void) {
    while (!go)
        ;
    TWBR = 12;
    sei();
    TWCR = _BV(TWINT) | _BV(TWSTA) | _BV(TWEN) | _BV(TWIE);
    for (;;)
        passes++;
}
