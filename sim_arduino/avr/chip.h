/* The chip, and what the chips have in common: registers at the same addresses in both. All that differs stands in the
 * header of each chip, which CHIP_HEADER names. Sources: the data sheets, "Register Summary", "Interrupts" and
 * "I/O-Ports".
 *
 * Addresses are those of the data space (I/O address + 32). Bits within a register stand in each peripheral.
 */
#ifndef MRL_CHIP_H
#define MRL_CHIP_H

#include <stdint.h>

enum { SMCR = 0x53, MCUSR = 0x54, WDTCSR = 0x60, EECR = 0x3F };
enum { GTCCR = 0x43, PRR0 = 0x64, PRR1 = 0x65, ASSR = 0xB6 };
enum { PCICR = 0x68, PCIFR = 0x3B, EICRA = 0x69, EIMSK = 0x3D, EIFR = 0x3C };
enum { TWBR = 0xB8, TWSR = 0xB9, TWDR = 0xBB, TWCR = 0xBC };
enum { ADCL = 0x78, ADCH = 0x79, ADCSRA = 0x7A, ADCSRB = 0x7B, ADMUX = 0x7C };
enum { CHANGE_GROUPS = 3, EXTERNAL_VECTOR = 1 }; /* INT0's; those of the others follow */

typedef struct {
    uint8_t port, bit;
} chip_pin_t;

#define NO_PIN {PORTS, 0}

typedef struct {
    uint16_t pin, ddr, port; /* registers */
    uint8_t change_pins;     /* pins with a pin-change interrupt, a bit each */
    uint8_t group, shift;    /* their group, and how far above the pin's its bit in PCMSK is */
    uint16_t pcmsk;
} chip_port_t;

/* The registers PIN, DDR and PORT follow each other. */
#define PORT_AT(pin) (pin), (pin) + 1, (pin) + 2

/* A USART. Its registers have the same distances to UCSRA in all; the vector of UDRE follows that of RX. */
typedef struct {
    uint16_t base;
    uint8_t rx_vector;
} chip_usart_t;

/* A timer has 8 bits and two compare units, or 16 bits, WIDE_UNITS of them and input capture. If it has 16 bits, these
 * are the addresses of the low bytes of its registers; the high byte follows each. */
typedef struct {
    uint16_t max;
    uint16_t tifr, timsk, tccra, tccrb, tcnt, ocr[3], icr;
    const uint16_t *dividers;      /* of the clock by CS */
    chip_pin_t output[3], capture; /* of its compare units A to C; the pin of its input capture */
} chip_timer_t;

/* The addresses of the registers from TCCRA on. */
#define NARROW_AT(tccra) (tccra), (tccra) + 1, (tccra) + 2, {(tccra) + 3, (tccra) + 4, 0}, 0
#define WIDE_AT(tccra) (tccra), (tccra) + 1, (tccra) + 4, {(tccra) + 8, (tccra) + 10, (tccra) + 12}, (tccra) + 6

/* Powers of two; 0 = the timer stands. */
static const uint16_t DIVIDERS[8] = {0, 1, 8, 64, 256, 1024, 0, 0};
static const uint16_t DIVIDERS_OF_TIMER2[8] = {0, 1, 8, 32, 64, 128, 256, 1024};

#include CHIP_HEADER

#endif
