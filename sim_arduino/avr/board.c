/* Shared by the peripherals and the run loop: growing arrays, and registers with a handler. */
#include "board.h"

#include <stdlib.h>
#include <string.h>

enum { SBI_HIGH = 0x9A, CBI_HIGH = 0x98 }; /* first byte of the opcodes */

bool board_room(void **items, size_t *room, size_t count, size_t item_size) {
    if (count < *room)
        return true;
    size_t wanted = *room ? 2 * *room : 64;
    void *grown = realloc(*items, wanted * item_size);
    if (!grown)
        return false;
    *items = grown;
    *room = wanted;
    return true;
}

/* Drops the first items of an array once they are half of it. */
void board_forget(void *items, size_t *first, size_t *count, size_t item_size) {
    if (!*first || *first < *count / 2)
        return;
    *count -= *first;
    memmove(items, (char *)items + *first * item_size, *count * item_size);
    *first = 0;
}

/* The bits that a write sets in a register where ones act and zeros do nothing.
 *
 * SBI and CBI act on their bit alone, but the core reads the register and writes all of it. */
uint8_t board_written_ones(const avr_t *avr, uint8_t value) {
    uint8_t high = avr->flash[avr->pc + 1], bit = (uint8_t)(1 << (avr->flash[avr->pc] & 7));
    if (high == SBI_HIGH)
        return bit;
    return high == CBI_HIGH ? 0 : value;
}

/* Write handler of a register of interrupt flags: a one clears. */
void board_clear_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    avr->data[address] &= (uint8_t)~board_written_ones(avr, value);
}

/* Stops the chip for good: the program uses what is not simulated. */
void board_refuse(board_t *board, const char *format, int value) {
    AVR_LOG(board->avr, LOG_ERROR, format, value);
    board->avr->state = cpu_Crashed;
}

/* Makes the run loop look at all interrupt sources after the current instruction. */
void board_recheck(board_t *board) {
    if (board->avr->interrupt_state == 0)
        board->avr->interrupt_state = 1;
}

void board_write_and_recheck(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    wrapped_t *wrapped = param;
    if (wrapped->write)
        wrapped->write(avr, address, value, wrapped->param);
    else
        avr->data[address] = value;
    board_recheck(wrapped->board);
}

/* Handlers of a register, which get `param`; NULL stands for plain memory. */
void board_on(board_t *board, int address, avr_io_write_t write, avr_io_read_t read, void *param) {
    avr_t *avr = board->avr;
    board->wrapped[address] = (wrapped_t){board, write, param};
    avr->io[address - 32].w.c = board_write_and_recheck;
    avr->io[address - 32].w.param = &board->wrapped[address];
    avr->io[address - 32].r.c = read;
    avr->io[address - 32].r.param = param;
}

/* Registers that are plain memory, from an address to another. */
void board_on_plain(board_t *board, int first, int last) {
    for (int address = first; address <= last; address++)
        board_on(board, address, NULL, NULL, board);
}
