/* Pin-change interrupts of D0 to D7 by `mask`, INT0 and INT1 by `sense`, after `go`; then a `command` each. D13 shows interrupts. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

volatile uint8_t mask = 0, enable = 0, sense = 0, external = 0, asleep = 0, writing = 0, masked_pin_change = 0, go = 0;
volatile uint8_t command = 0, value = 0, flags = 0, reset_flags = 0;
volatile uint16_t changes = 0, externals = 0;

/* The first instruction of the routine toggles D13; the rest is that of a vector that nothing else needs. */
ISR(PCINT2_vect, ISR_NAKED) {
    asm volatile("sbi %0, 5 \n jmp __vector_17" ::"I"(_SFR_IO_ADDR(PINB)));
}
ISR(SPI_STC_vect) { changes++; }
ISR(INT0_vect) { externals++; }
ISR(INT1_vect, ISR_ALIASOF(INT0_vect));

enum { READ = 1, CLEAR, CLEAR_BY_SBI, ENABLE, DIRECTION, PORT, TOGGLE, PWM, INTERRUPTS_OFF, INTERRUPTS_ON, CBI_OF_FLAG };

static void obey(void) {
    switch (command) {
    case READ: flags = PCIFR; break;
    case CLEAR: PCIFR = value; break;
    case CLEAR_BY_SBI: PCIFR |= _BV(PCIF2); break;
    case ENABLE: PCICR = value; break;
    case DIRECTION: DDRD = value; break;
    case PORT: PORTD = value; break;
    case TOGGLE: PIND |= _BV(7); break;
    case PWM:
        TCCR0A = _BV(COM0B1) | _BV(WGM01) | _BV(WGM00);
        OCR0B = value;
        TCCR0B = _BV(CS01);
        break;
    case INTERRUPTS_OFF: cli(); break;
    case INTERRUPTS_ON: sei(); break;
    case CBI_OF_FLAG: PCIFR &= (uint8_t)~_BV(PCIF1); break;
    }
    command = 0;
}

int main(void) {
    reset_flags = MCUSR;
    while (!go)
        ;
    DDRB = _BV(5);
    PCMSK2 = mask;
    PCMSK0 = masked_pin_change;
    EICRA = sense;
    PCIFR = 0xFF;
    EIFR = 0xFF;
    PCICR = enable;
    EIMSK = external;
    sei();
    for (;;) {
        if (command)
            obey();
        while (writing)
            PCICR = enable;
        if (asleep)
            sleep_mode();
    }
}
