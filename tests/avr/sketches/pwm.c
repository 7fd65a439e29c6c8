/* Timer 0 (OC0A D6, OC0B D5), 1 (OC1A D9, OC1B D10) or 2 (OC2A D11, OC2B D3) as the test sets it up, after `go`; then a
 * `command` each. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>

volatile uint8_t timer = 0, control_a = 0, control_b = 0, compare_a = 0, compare_b = 0, outputs = 0;
volatile uint8_t enable = 0, go = 0, command = 0, value = 0, flags = 0, pins = 0;
volatile uint16_t count = 0, overflows = 0, matches_a = 0, matches_b = 0;

ISR(TIMER0_OVF_vect) { overflows++; }
ISR(TIMER0_COMPA_vect) { matches_a++; }
ISR(TIMER0_COMPB_vect) { matches_b++; }
ISR(TIMER1_OVF_vect, ISR_ALIASOF(TIMER0_OVF_vect));
ISR(TIMER2_OVF_vect, ISR_ALIASOF(TIMER0_OVF_vect));
ISR(TIMER1_COMPA_vect, ISR_ALIASOF(TIMER0_COMPA_vect));
ISR(TIMER2_COMPA_vect, ISR_ALIASOF(TIMER0_COMPA_vect));
ISR(TIMER1_COMPB_vect, ISR_ALIASOF(TIMER0_COMPB_vect));
ISR(TIMER2_COMPB_vect, ISR_ALIASOF(TIMER0_COMPB_vect));

enum { WRITE_A = 1, WRITE_B, WRITE_CONTROL_A, WRITE_CONTROL_B, WRITE_COUNT, READ, CLEAR, DIRECTION, PORT, CLEAR_BY_SBI, SLEEP };

#define START(n)             \
    do {                     \
        OCR##n##A = compare_a; \
        OCR##n##B = compare_b; \
        TCNT##n = count;     \
        TIMSK##n = enable;   \
        TCCR##n##A = control_a; \
        TCCR##n##B = control_b; \
    } while (0)

#define OBEY(n)                                              \
    switch (command) {                                       \
    case WRITE_A: OCR##n##A = value; break;                  \
    case WRITE_B: OCR##n##B = value; break;                  \
    case WRITE_CONTROL_A: TCCR##n##A = value; break;         \
    case WRITE_CONTROL_B: TCCR##n##B = value; break;         \
    case WRITE_COUNT: TCNT##n = value; break;                \
    case READ: count = TCNT##n, flags = TIFR##n, pins = PIND; break; \
    case CLEAR: TIFR##n = value; break;                      \
    case DIRECTION: DDRD = value; break;                     \
    case PORT: PORTD = value; break;                         \
    case CLEAR_BY_SBI: TIFR##n |= _BV(OCF0A); break;         \
    case SLEEP: sleep_mode(); break;                         \
    }

int main(void) {
    while (!go)
        ;
    DDRD = outputs;
    DDRB = outputs;
    switch (timer) {
    case 0: START(0); break;
    case 1: START(1); break;
    case 2: START(2); break;
    }
    sei();
    for (;;) {
        if (!command)
            continue;
        switch (timer) {
        case 0: OBEY(0) break;
        case 1: OBEY(1) break;
        case 2: OBEY(2) break;
        }
        command = 0;
    }
}
