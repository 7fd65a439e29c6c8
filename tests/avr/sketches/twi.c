/* Runs the I2C script in `script` once `go` is set: each step is a TWCR value and a byte for TWDR; statuses and
 * cycle counts (timer 1) are kept. Step 0xFF ends. */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint8_t go = 0, done = 0, bit_rate = 72, prescaler = 0;
volatile uint8_t control[24], value[24], status[24], received[24];
volatile uint16_t elapsed[24];

int main(void) {
    TCCR1B = _BV(CS10);
    while (!go)
        ;
    TWBR = bit_rate;
    TWSR = prescaler;
    for (uint8_t i = 0; control[i] != 0xFF; i++) {
        if (!(control[i] & _BV(TWSTA)) && !(control[i] & _BV(TWSTO)))
            TWDR = value[i];
        uint16_t start = TCNT1;
        TWCR = control[i];
        if (!(control[i] & _BV(TWEN)))
            ;
        else if (control[i] & _BV(TWSTO))
            while (TWCR & _BV(TWSTO))
                ;
        else
            while (!(TWCR & _BV(TWINT)))
                ;
        elapsed[i] = TCNT1 - start;
        status[i] = TWSR & 0xF8;
        received[i] = TWDR;
    }
    done = 1;
    for (;;)
        ;
}
