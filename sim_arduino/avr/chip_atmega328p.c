/* ATmega328P, the chip of the Arduino Uno and Nano. Source: its data sheet, "Register Summary", "Interrupts" and
 * "I/O-Ports". */
#include "chip.h"

enum { B, C, D };

const chip_t chip_atmega328p = {
    .name = "atmega328p",
    .memory = {.flash = 32768, .eeprom = 1024, .ram_end = 0x8FF},
    .control = {.smcr = 0x53, .mcusr = 0x54},
    .ports = {[B] = {.pin = 0x23, .ddr = 0x24, .port = 0x25, .pcmsk = 0x6B, .group = 0},
              [C] = {.pin = 0x26, .ddr = 0x27, .port = 0x28, .pcmsk = 0x6C, .group = 1},
              [D] = {.pin = 0x29, .ddr = 0x2A, .port = 0x2B, .pcmsk = 0x6D, .group = 2}},
    .pin_interrupts = {.pcicr = 0x68, .pcifr = 0x3B, .eicra = 0x69, .eimsk = 0x3D, .eifr = 0x3C,
                       .externals = {{1, {D, 2}}, {2, {D, 3}}}},
    .watchdog = {.vector = 6, .wdtcsr = 0x60},
    .usart = {.rx_vector = 18, .udre_vector = 19, .ucsra = 0xC0, .ucsrb = 0xC1, .ucsrc = 0xC2, .ubrrl = 0xC4,
              .ubrrh = 0xC5, .udr = 0xC6},
    .twi = {.vector = 24, .twbr = 0xB8, .twsr = 0xB9, .twdr = 0xBB, .twcr = 0xBC, .sda = {C, 4}, .scl = {C, 5}},
    .adc = {.adcl = 0x78, .adch = 0x79, .adcsra = 0x7A, .adcsrb = 0x7B, .admux = 0x7C, .pins = 8,
            .bandgap_channel = 14},
    .eeprom = {.ready_vector = 22, .eecr = 0x3F},
    .timer8 = {{.tifr = 0x35, .timsk = 0x6E, .tccra = 0x44, .tccrb = 0x45, .tcnt = 0x46, .ocr = {0x47, 0x48},
                .dividers = {0, 1, 8, 64, 256, 1024, 0, 0}, .output = {{D, 6}, {D, 5}}},
               {.tifr = 0x37, .timsk = 0x70, .tccra = 0xB0, .tccrb = 0xB1, .tcnt = 0xB2, .ocr = {0xB3, 0xB4},
                .dividers = {0, 1, 8, 32, 64, 128, 256, 1024}, .output = {{B, 3}, {D, 3}}}},
    .timer1 = {.tifr = 0x36, .timsk = 0x6F, .tccra = 0x80, .tccrb = 0x81, .tcnt = 0x84, .icr = 0x86,
               .ocr = {0x88, 0x8A}, .dividers = {0, 1, 8, 64, 256, 1024, 0, 0}, .capture = {B, 0}},
};
