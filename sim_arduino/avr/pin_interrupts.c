/* Interrupts of pins: pin changes (PCINT), and INT0 and INT1. Outputs cause them as inputs do.
 *
 * The flag is set at the cycle of the edge: the chip's synchroniser and the three cycles after it are not simulated.
 */
#include "board.h"

enum { SENSE_LOW = 0, SENSE_ANY = 1, SENSE_FALLING = 2, SENSE_RISING = 3, SENSE_BITS = 2 };

static int sense(const board_t *board, int number) {
    return board->avr->data[EICRA] >> (SENSE_BITS * number) & 3;
}

static bool is_edge(int sense, bool high) {
    return sense == SENSE_ANY || sense == (high ? SENSE_RISING : SENSE_FALLING);
}

/* Pins of a port have changed their level. A flag is set whatever PCICR and EIMSK say, but not without PCMSK. */
void pin_interrupts_changed(board_t *board, int port, uint8_t changed, uint8_t level) {
    uint8_t *data = board->avr->data;
    if (changed & data[CHIP_PORTS[port].pcmsk])
        data[PCIFR] |= (uint8_t)(1 << port);
    for (int i = 0; i < EXTERNALS; i++) {
        chip_pin_t pin = CHIP_EXTERNALS[i].pin;
        if (pin.port == port && (changed >> pin.bit & 1) && is_edge(sense(board, i), level >> pin.bit & 1))
            data[EIFR] |= (uint8_t)(1 << i);
    }
    board_recheck(board);
}

/* An edge of the pin may set a flag. */
bool pin_interrupts_observe(const board_t *board, chip_pin_t pin) {
    const uint8_t *data = board->avr->data;
    if (data[CHIP_PORTS[pin.port].pcmsk] >> pin.bit & 1)
        return true;
    for (int i = 0; i < EXTERNALS; i++)
        if (CHIP_EXTERNALS[i].pin.port == pin.port && CHIP_EXTERNALS[i].pin.bit == pin.bit)
            return sense(board, i) != SENSE_LOW || (data[EIMSK] >> i & 1);
    return false;
}

/* INT0 or INT1 requests an interrupt as long as its pin is low, without a flag. */
bool pin_interrupts_level_requests(const board_t *board, uint8_t vector) {
    for (int i = 0; i < EXTERNALS; i++) {
        chip_pin_t pin = CHIP_EXTERNALS[i].pin;
        if (vector == CHIP_EXTERNALS[i].vector)
            return sense(board, i) == SENSE_LOW && !(board->pins.ports[pin.port].level >> pin.bit & 1);
    }
    return false;
}

/* A pin that a timer drives is followed from now on, or no longer. */
static void write_mask(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    avr->data[address] = value;
    timers_pins_changed(param);
}

void pin_interrupts_attach(board_t *board) {
    for (int port = 0; port < PORTS; port++)
        board_on(board, CHIP_PORTS[port].pcmsk, write_mask, NULL, board);
    board_on_plain(board, PCICR, PCICR);
    board_on(board, EICRA, write_mask, NULL, board);
    board_on(board, EIMSK, write_mask, NULL, board);
    board_on(board, PCIFR, board_clear_flags, NULL, board);
    board_on(board, EIFR, board_clear_flags, NULL, board);
}
