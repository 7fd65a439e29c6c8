/* Shared by the peripherals and the run loop: growing arrays, and registers with a handler. */
#include "board.h"

#include <stdlib.h>

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

void board_on_write(board_t *board, int address, avr_io_write_t handler) {
    board->wrapped[address] = (wrapped_t){board, handler, board};
    board->avr->io[address - 32].w.c = board_write_and_recheck;
    board->avr->io[address - 32].w.param = &board->wrapped[address];
}

void board_on_read(board_t *board, int address, avr_io_read_t handler) {
    board->avr->io[address - 32].r.c = handler;
    board->avr->io[address - 32].r.param = board;
}
