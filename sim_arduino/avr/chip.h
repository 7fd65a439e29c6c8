/* The facts of a chip that differ between AVRs: sizes, register addresses, vectors, pins. The peripherals read them
 * here.
 *
 * Addresses are those of the data space (I/O address + 32). Bits within a register are the same on all chips of the
 * family, so each peripheral keeps its own.
 */
#ifndef MRL_CHIP_H
#define MRL_CHIP_H

#include <stdint.h>

enum { PORTS = 3, TIMERS8 = 2, OUTPUTS = 2, EXTERNALS = 2, VECTORS = 32, IO_ADDRESSES = 256 };

typedef struct {
    uint8_t port, bit;
} chip_pin_t;

typedef struct {
    uint8_t pin, ddr, port; /* registers */
    uint8_t pcmsk;          /* pin changes: mask of the port's pins, in its order of bits */
    uint8_t group;          /* bit of PCICR and PCIFR */
} chip_port_t;

typedef struct {
    uint8_t pcicr, pcifr;
    uint8_t eicra, eimsk, eifr;
    struct {
        uint8_t vector;
        chip_pin_t pin;
    } externals[EXTERNALS]; /* INT0 and INT1 */
} chip_pin_interrupts_t;

typedef struct {
    uint32_t flash, eeprom; /* bytes */
    uint32_t ram_end;       /* last address of the SRAM */
} chip_memory_t;

typedef struct {
    uint8_t smcr, mcusr;
} chip_control_t;

typedef struct {
    uint8_t vector, wdtcsr;
} chip_watchdog_t;

typedef struct {
    uint8_t rx_vector, udre_vector;
    uint8_t ucsra, ucsrb, ucsrc, ubrrl, ubrrh, udr;
} chip_usart_t;

typedef struct {
    uint8_t vector;
    uint8_t twbr, twsr, twdr, twcr;
    chip_pin_t sda, scl;
} chip_twi_t;

typedef struct {
    uint8_t adcl, adch, adcsra, adcsrb, admux;
    uint8_t pins, bandgap_channel; /* analogue pins are the channels 0 to `pins` - 1 */
} chip_adc_t;

typedef struct {
    uint8_t ready_vector, eecr;
} chip_eeprom_t;

/* Timer with 8 bits: its compare units A and B have one output pin each. */
typedef struct {
    uint8_t tifr, timsk, tccra, tccrb, tcnt, ocr[OUTPUTS];
    uint16_t dividers[8]; /* of the clock by CS, powers of two; 0 = the timer stands */
    chip_pin_t output[OUTPUTS];
} chip_timer8_t;

/* Timer with 16 bits: addresses of the low bytes; the high byte follows each. */
typedef struct {
    uint8_t tifr, timsk, tccra, tccrb, tcnt, icr, ocr[2];
    uint16_t dividers[8]; /* of the clock by CS; 0 = the timer stands */
    chip_pin_t capture;
} chip_timer16_t;

typedef struct {
    const char *name; /* libsimavr's */
    chip_memory_t memory;
    chip_control_t control;
    chip_port_t ports[PORTS];
    chip_pin_interrupts_t pin_interrupts;
    chip_watchdog_t watchdog;
    chip_usart_t usart;
    chip_twi_t twi;
    chip_adc_t adc;
    chip_eeprom_t eeprom;
    chip_timer8_t timer8[TIMERS8];
    chip_timer16_t timer1;
} chip_t;

extern const chip_t chip_atmega328p;

#endif
