/* A table and a function above 128 KiB of flash, and the last byte of the EEPROM. */
#include <avr/eeprom.h>
#include <avr/io.h>
#include <avr/pgmspace.h>

static const uint8_t table[2] __attribute__((section(".table"), used)) = {0x5A, 0xC3};
volatile uint8_t found[2], called = 0, marker = 7;
volatile uint16_t last = E2END;

__attribute__((section(".far"), noinline, used)) void far_function(uint8_t value) { called = (uint8_t)(value + marker); }

int main(void) {
    found[0] = pgm_read_byte_far(pgm_get_far_address(table));
    found[1] = pgm_read_byte_far(pgm_get_far_address(table) + 1);
    void (*volatile function)(uint8_t) = far_function; /* called by EICALL, through a stub in low flash */
    function(35);
    eeprom_write_byte((uint8_t *)last, 0x42);
    for (;;)
        ;
}
