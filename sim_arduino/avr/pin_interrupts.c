/* Interrupts of pins: pin changes (PCINT), and external interrupts (INT). Outputs cause them as inputs do.
 *
 * The flag is set at the cycle of the edge: the chip's synchroniser and the three cycles after it are not simulated.
 */
#include "board.h"

enum { SENSE_LOW = 0, SENSE_ANY = 1, SENSE_FALLING = 2, SENSE_RISING = 3, SENSE_BITS = 2, SENSES = 4 };

static int sense(const board_t *board, int number) {
    return board->avr->data[EICRA + number / SENSES] >> SENSE_BITS * (number % SENSES) & 3;
}

/* The port's pins among these whose changes set a flag. */
static uint8_t changes_seen(const board_t *board, int port, uint8_t pins) {
    const chip_port_t *at = &CHIP_PORTS[port];
    return (uint8_t)((pins & at->change_pins) & board->avr->data[at->pcmsk] >> at->shift);
}

static bool is_edge(int sense, bool high) {
    return sense == SENSE_ANY || sense == (high ? SENSE_RISING : SENSE_FALLING);
}

/* Pins of a port have changed their level. A flag is set whatever PCICR and EIMSK say, but not without PCMSK. */
void pin_interrupts_changed(board_t *board, int port, uint8_t changed, uint8_t level) {
    uint8_t *data = board->avr->data;
    if (changes_seen(board, port, changed))
        data[PCIFR] |= (uint8_t)(1 << CHIP_PORTS[port].group);
    for (int i = 0; i < EXTERNALS; i++) {
        chip_pin_t pin = CHIP_EXTERNALS[i];
        if (pin.port == port && (changed >> pin.bit & 1) && is_edge(sense(board, i), level >> pin.bit & 1))
            data[EIFR] |= (uint8_t)(1 << i);
    }
    board_recheck(board);
}

/* An edge of the pin may set a flag. */
bool pin_interrupts_observe(const board_t *board, chip_pin_t pin) {
    const uint8_t *data = board->avr->data;
    if (changes_seen(board, pin.port, (uint8_t)(1 << pin.bit)))
        return true;
    for (int i = 0; i < EXTERNALS; i++)
        if (CHIP_EXTERNALS[i].port == pin.port && CHIP_EXTERNALS[i].bit == pin.bit)
            return sense(board, i) != SENSE_LOW || (data[EIMSK] >> i & 1);
    return false;
}

/* An external interrupt is requested as long as its pin is low, without a flag. */
bool pin_interrupts_level_requests(const board_t *board, uint8_t vector) {
    int number = vector - EXTERNAL_VECTOR;
    chip_pin_t pin = CHIP_EXTERNALS[number];
    return sense(board, number) == SENSE_LOW && !(board->pins.ports[pin.port].level >> pin.bit & 1);
}

/* A pin that a timer drives is followed from now on, or no longer. */
static void write_mask(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    avr->data[address] = value;
    timers_pins_changed(param);
}

void pin_interrupts_attach(board_t *board) {
    for (int port = 0; port < PORTS; port++)
        if (CHIP_PORTS[port].change_pins)
            board_on(board, CHIP_PORTS[port].pcmsk, write_mask, NULL, board);
    board_on_plain(board, PCICR, PCICR);
    for (int number = 0; number < EXTERNALS; number += SENSES)
        board_on(board, EICRA + number / SENSES, write_mask, NULL, board);
    board_on(board, EIMSK, write_mask, NULL, board);
    board_on(board, PCIFR, board_clear_flags, NULL, board);
    board_on(board, EIFR, board_clear_flags, NULL, board);
}
