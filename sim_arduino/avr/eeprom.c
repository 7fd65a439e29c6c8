/* EEPROM: the core's memory and programming sequence; busy for 3.4 ms a byte, ready interrupt while idle. */
#include "board.h"

#include <simavr/avr_eeprom.h>

enum { EEPE = 0x02, EEMPE = 0x04, EERE = 0x01, EEPM = 0x30 };
enum { ERASE_AND_WRITE_US = 3400, HALF_US = 1800, HALTED_READING = 4, HALTED_WRITING = 2 };

static avr_cycle_count_t written(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    avr->data[EECR] &= (uint8_t)~EEPE;
    board_recheck(board);
    return 0;
}

static void begin_write(board_t *board) {
    avr_t *avr = board->avr;
    uint64_t duration_us = avr->data[EECR] & EEPM ? HALF_US : ERASE_AND_WRITE_US;
    avr->data[EECR] |= EEPE;
    avr->cycle += HALTED_WRITING;
    avr_cycle_timer_register(avr, duration_us * (avr->frequency / 1000000), written, board);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    wrapped_t *stock = &board->eeprom_control;
    uint8_t before = avr->data[address];
    bool busy = before & EEPE;
    bool starts = !busy && (before & EEMPE) && (value & EEPE);
    stock->write(avr, address, busy ? value & (uint8_t)~(EEPE | EERE) : value, stock->param);
    if (busy)
        avr->data[address] |= EEPE;
    if (starts)
        begin_write(board);
    if (!busy && (value & EERE))
        avr->cycle += HALTED_READING;
}

bool eeprom_is_ready(const board_t *board) { return !(board->avr->data[EECR] & EEPE); }

/* The core's bytes. */
EXPORT uint8_t *mrl_eeprom(board_t *board) {
    avr_eeprom_desc_t view = {.ee = NULL};
    avr_ioctl(board->avr, AVR_IOCTL_EEPROM_GET, &view);
    return view.ee;
}

void eeprom_attach(board_t *board) {
    int io = EECR - 32;
    board->eeprom_control = (wrapped_t){board, board->avr->io[io].w.c, board->avr->io[io].w.param};
    board_on(board, EECR, write_control, NULL, board);
}
