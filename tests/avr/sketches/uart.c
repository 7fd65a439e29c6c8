/* 115200 baud as the Arduino core sets it (UBRR 16, U2X). Sends what `outgoing` says; reads into `incoming` when
 * `listen` is set, or by interrupt. */
#include <avr/interrupt.h>
#include <avr/io.h>

#ifdef USART0_RX_vect
#define USART_RX_vect USART0_RX_vect
#define USART_UDRE_vect USART0_UDRE_vect
#endif

volatile uint8_t outgoing_count = 0, listen = 1, status_seen = 0;
volatile uint8_t incoming[64], incoming_count = 0, statuses[64];
volatile uint8_t sent = 0, use_interrupts = 0;

ISR(USART_RX_vect) {
    statuses[incoming_count & 63] = UCSR0A;
    incoming[incoming_count & 63] = UDR0;
    incoming_count++;
}

ISR(USART_UDRE_vect) {
    UDR0 = 'a' + sent++;
    if (sent >= outgoing_count)
        UCSR0B &= ~_BV(UDRIE0);
}

int main(void) {
    UBRR0 = 16;
    UCSR0A = _BV(U2X0);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0);
    sei();
    for (;;) {
        if (use_interrupts) {
            UCSR0B |= _BV(RXCIE0);
            if (sent < outgoing_count)
                UCSR0B |= _BV(UDRIE0);
            continue;
        }
        if (sent < outgoing_count && (UCSR0A & _BV(UDRE0)))
            UDR0 = 'a' + sent++;
        if (listen && (UCSR0A & _BV(RXC0))) {
            statuses[incoming_count & 63] = UCSR0A;
            incoming[incoming_count & 63] = UDR0;
            incoming_count++;
        }
        status_seen = UCSR0A;
    }
}
