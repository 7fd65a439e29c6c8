/* The ATmega328P, the chip of the Arduino Uno and Nano: register addresses, vectors, pins. Source: its data sheet,
 * "Register Summary", "Interrupts" and "I/O-Ports".
 *
 * Addresses are those of the data space (I/O address + 32). Bits within a register stand in each peripheral.
 */
#ifndef MRL_CHIP_H
#define MRL_CHIP_H

#include <stdint.h>

#define CHIP_NAME "atmega328p" /* libsimavr's */

enum { PORTS = 3, TIMERS = 3, OUTPUTS = 2, EXTERNALS = 2, VECTORS = 32, IO_ADDRESSES = 256 };
enum { PORT_B, PORT_C, PORT_D };
enum { WATCHDOG_VECTOR = 6, RX_VECTOR = 18, UDRE_VECTOR = 19, EEPROM_VECTOR = 22, TWI_VECTOR = 24 };

enum { SMCR = 0x53, MCUSR = 0x54, WDTCSR = 0x60, EECR = 0x3F };
enum { PCICR = 0x68, PCIFR = 0x3B, EICRA = 0x69, EIMSK = 0x3D, EIFR = 0x3C };
enum { UCSRA = 0xC0, UCSRB = 0xC1, UCSRC = 0xC2, UBRRL = 0xC4, UBRRH = 0xC5, UDR = 0xC6 };
enum { TWBR = 0xB8, TWSR = 0xB9, TWDR = 0xBB, TWCR = 0xBC };
enum { ADCL = 0x78, ADCH = 0x79, ADCSRA = 0x7A, ADCSRB = 0x7B, ADMUX = 0x7C };
enum { ADC_PINS = 8, ADC_BANDGAP = 14 }; /* channels: analogue pins from 0 on, and the internal reference */
enum { ICR1 = 0x86 };

typedef struct {
    uint8_t port, bit;
} chip_pin_t;

static const chip_pin_t SDA_PIN = {PORT_C, 4}, SCL_PIN = {PORT_C, 5}, CAPTURE_PIN = {PORT_B, 0};

typedef struct {
    uint8_t pin, ddr, port; /* registers */
    uint8_t pcmsk;          /* pin changes: mask of the port's pins, in its order of bits */
} chip_port_t;

static const chip_port_t CHIP_PORTS[PORTS] = {
    {0x23, 0x24, 0x25, 0x6B}, {0x26, 0x27, 0x28, 0x6C}, {0x29, 0x2A, 0x2B, 0x6D}};

/* INT0 and INT1. */
static const struct {
    uint8_t vector;
    chip_pin_t pin;
} CHIP_EXTERNALS[EXTERNALS] = {{1, {PORT_D, 2}}, {2, {PORT_D, 3}}};

/* A timer. If it has 16 bits, these are the addresses of the low bytes of its registers; the high byte follows each. */
typedef struct {
    uint16_t max;
    uint8_t tifr, timsk, tccra, tccrb, tcnt, ocr[OUTPUTS];
    uint16_t dividers[8];       /* of the clock by CS, powers of two; 0 = the timer stands */
    chip_pin_t output[OUTPUTS]; /* of its compare units A and B */
} chip_timer_t;

enum { TIMER0, TIMER2, TIMER1 };
static const chip_timer_t CHIP_TIMERS[TIMERS] = {
    [TIMER0] = {0xFF, 0x35, 0x6E, 0x44, 0x45, 0x46, {0x47, 0x48}, {0, 1, 8, 64, 256, 1024, 0, 0},
                {{PORT_D, 6}, {PORT_D, 5}}},
    [TIMER2] = {0xFF, 0x37, 0x70, 0xB0, 0xB1, 0xB2, {0xB3, 0xB4}, {0, 1, 8, 32, 64, 128, 256, 1024},
                {{PORT_B, 3}, {PORT_D, 3}}},
    [TIMER1] = {0xFFFF, 0x36, 0x6F, 0x80, 0x81, 0x84, {0x88, 0x8A}, {0, 1, 8, 64, 256, 1024, 0, 0},
                {{PORT_B, 1}, {PORT_B, 2}}},
};

#endif
