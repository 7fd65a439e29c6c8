/* EEPROM, stray pointers, stack depth, pins. */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>

volatile uint8_t action = 0, done = 0, eeprom_byte = 0, pins_seen = 0;
volatile uint16_t elapsed = 0, stray = 0x1234, depth = 0;
volatile uint8_t kept __attribute__((section(".noinit")));

static void __attribute__((noinline)) recurse(uint16_t bytes) {
    volatile uint8_t room[32];
    for (uint8_t i = 0; i < sizeof room; i++)
        room[i] = (uint8_t)(i * 7 + 1);
    if (bytes > sizeof room)
        recurse(bytes - sizeof room);
    done = room[3];
}

static void write_eeprom(void) {
    uint16_t start = TCNT1;
    EEAR = 5;
    EEDR = 0x42;
    EECR |= _BV(EEMPE);
    EECR |= _BV(EEPE);
    while (EECR & _BV(EEPE))
        ;
    elapsed = TCNT1 - start;
}

static void clock_by_hand(void) { /* nine falling edges on SCL (A5), open drain */
    PORTC &= ~_BV(5);
    for (uint8_t i = 0; i < 9; i++) {
        DDRC |= _BV(5);
        DDRC &= ~_BV(5);
    }
    pins_seen = PINC;
}

int main(void) {
    TCCR1B = _BV(CS11) | _BV(CS10); /* 4 us */
    for (;;) {
        uint8_t now = action; /* read once: it may be set at any instruction */
        switch (now) {
        case 1: eeprom_byte = eeprom_read_byte((uint8_t *)5); break;
        case 2: write_eeprom(); break;
        case 3: *(volatile uint8_t *)stray = 1; break;
        case 4: recurse(depth); break;
        case 5: pins_seen = PINC; break;
        case 6: clock_by_hand(); break;
        case 7: DDRD |= _BV(7); PORTD |= _BV(7); PORTD &= ~_BV(7); break;
        }
        if (now) {
            action = 0;
            done = 1;
        }
    }
}
