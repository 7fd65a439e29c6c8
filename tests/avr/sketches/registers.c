/* Reads and writes registers as the test says with `command`, and counts interrupts by their vectors. */
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint16_t address = 0, word = 0;
volatile uint8_t command = 0, value = 0, interrupts[64];

enum { WRITE = 1, READ, WRITE_WORD };

#define COUNT(vector) \
    ISR(vector) { interrupts[vector##_num]++; }

COUNT(INT0_vect)
COUNT(INT1_vect)
COUNT(PCINT0_vect)
COUNT(PCINT1_vect)
COUNT(PCINT2_vect)
COUNT(TIMER0_OVF_vect)
COUNT(TIMER0_COMPA_vect)
COUNT(TIMER0_COMPB_vect)
COUNT(TIMER1_OVF_vect)
COUNT(TIMER1_CAPT_vect)
COUNT(TIMER1_COMPA_vect)
COUNT(TIMER1_COMPB_vect)
COUNT(TIMER2_OVF_vect)
COUNT(TIMER2_COMPA_vect)
COUNT(TIMER2_COMPB_vect)
COUNT(ADC_vect)
#ifdef __AVR_ATmega2560__
COUNT(INT2_vect)
COUNT(INT3_vect)
COUNT(INT4_vect)
COUNT(INT5_vect)
COUNT(INT6_vect)
COUNT(INT7_vect)
COUNT(TIMER1_COMPC_vect)
COUNT(TIMER3_OVF_vect)
COUNT(TIMER3_CAPT_vect)
COUNT(TIMER3_COMPA_vect)
COUNT(TIMER3_COMPB_vect)
COUNT(TIMER3_COMPC_vect)
COUNT(TIMER4_OVF_vect)
COUNT(TIMER4_CAPT_vect)
COUNT(TIMER4_COMPA_vect)
COUNT(TIMER4_COMPB_vect)
COUNT(TIMER4_COMPC_vect)
COUNT(TIMER5_OVF_vect)
COUNT(TIMER5_CAPT_vect)
COUNT(TIMER5_COMPA_vect)
COUNT(TIMER5_COMPB_vect)
COUNT(TIMER5_COMPC_vect)
#endif

int main(void) {
    sei();
    for (;;) {
        uint8_t now = command; /* read once: it may be set at any instruction */
        if (!now)
            continue;
        switch (now) {
        case WRITE: *(volatile uint8_t *)address = value; break;
        case READ: value = *(volatile uint8_t *)address; break;
        case WRITE_WORD: *(volatile uint16_t *)address = word; break;
        }
        command = 0;
    }
}
