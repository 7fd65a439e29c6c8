/* The watchdog's interrupt leaves a marker in SRAM that no start clears; `mode` chooses what is set up. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>

volatile uint8_t marker __attribute__((section(".noinit")));
volatile uint8_t marker_at_start, flags_at_start, control_at_start;
volatile uint8_t starts __attribute__((section(".noinit")));
volatile uint8_t mode = 0, interrupts = 0, control_now = 0, control_cleared;
volatile uint8_t stay_off __attribute__((section(".noinit")));

enum { IN_TIME = 0x5A, TOO_EARLY = 0x5B };
enum { RESET_ONLY = 1, INTERRUPT_ONLY, INTERRUPT_THEN_RESET, MASKED, FED, NO_SEQUENCE, REARMED };

ISR(WDT_vect) {
    interrupts++;
    marker = 0xA5;
    if (mode == REARMED && interrupts < 3)
        WDTCSR |= _BV(WDIE);
    if (mode == INTERRUPT_THEN_RESET)
        for (;;)
            ;
}

static void set_up(uint8_t bits) {
    WDTCSR = _BV(WDCE) | _BV(WDE);
    WDTCSR = bits;
}

int main(void) {
    control_at_start = WDTCSR;
    marker_at_start = marker;
    flags_at_start = MCUSR;
    if (stay_off == TOO_EARLY)
        wdt_disable();
    MCUSR = 0;
    starts++;
    control_cleared = WDTCSR;
    if (stay_off == IN_TIME)
        wdt_disable();
    while (!mode)
        ;
    wdt_reset();
    if (mode == RESET_ONLY)
        set_up(_BV(WDE));
    if (mode == INTERRUPT_ONLY)
        set_up(_BV(WDIE) | _BV(WDP0));
    if (mode == INTERRUPT_THEN_RESET || mode == MASKED || mode == FED || mode == REARMED)
        set_up(_BV(WDIE) | _BV(WDE));
    if (mode == NO_SEQUENCE) {
        set_up(_BV(WDE) | _BV(WDP2));
        WDTCSR = _BV(WDP3);
    }
    control_now = WDTCSR;
    if (mode != MASKED)
        sei();
    for (;;)
        if (mode == FED)
            wdt_reset();
}
