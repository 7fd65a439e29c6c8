/* Each USART of an ATmega2560 sends back what it receives plus its number, by interrupts, at 115200 baud. */
#include <avr/interrupt.h>
#include <avr/io.h>

#define ECHO(n)                                             \
    static volatile uint8_t waiting##n;                     \
    ISR(USART##n##_RX_vect) {                               \
        waiting##n = (uint8_t)(UDR##n + n);                 \
        UCSR##n##B |= _BV(UDRIE##n);                        \
    }                                                       \
    ISR(USART##n##_UDRE_vect) {                             \
        UDR##n = waiting##n;                                \
        UCSR##n##B &= ~_BV(UDRIE##n);                       \
    }                                                       \
    static void begin##n(void) {                            \
        UBRR##n = 16;                                       \
        UCSR##n##A = _BV(U2X##n);                           \
        UCSR##n##B = _BV(RXEN##n) | _BV(TXEN##n) | _BV(RXCIE##n); \
    }

ECHO(0)
ECHO(1)
ECHO(2)
ECHO(3)

int main(void) {
    begin0();
    begin1();
    begin2();
    begin3();
    sei();
    for (;;)
        ;
}
