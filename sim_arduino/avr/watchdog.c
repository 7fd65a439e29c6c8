/* Watchdog: 2048 << WDP cycles of 128 kHz, interrupt, reset, and interrupt followed by reset. */
#include "board.h"

enum { WDIF = 0x80, WDIE = 0x40, WDP3 = 0x20, WDCE = 0x10, WDE = 0x08, WDP012 = 0x07, WDRF = 0x08 };
enum { OSCILLATOR_HZ = 128000, SHORTEST = 2048, CHANGE_WINDOW_CYCLES = 4 };

static uint64_t period(const board_t *board) {
    uint8_t control = board->avr->data[WDTCSR];
    unsigned step = (control & WDP012) | (control & WDP3 ? 8 : 0);
    uint64_t ticks = (uint64_t)SHORTEST << (step > 9 ? 9 : step);
    return ticks * board->avr->frequency / OSCILLATOR_HZ;
}

/* An interrupt still waiting at the next time-out becomes a reset. */
static avr_cycle_count_t timed_out(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    uint8_t *control = &avr->data[WDTCSR];
    if ((*control & WDIE) && !((*control & WDIF) && (*control & WDE))) {
        *control |= WDIF;
        board_recheck(board);
    } else if (*control & WDE) {
        board->reset_wanted = true;
        return 0;
    }
    return when + period(board);
}

/* WDTCSR once the vector has been entered: with WDE set, the next time-out resets. */
uint8_t watchdog_served(uint8_t control) {
    uint8_t cleared = control & WDE ? WDIF | WDIE : WDIF;
    return control & (uint8_t)~cleared;
}

void watchdog_kick(board_t *board) {
    avr_cycle_timer_cancel(board->avr, timed_out, board);
    if (board->avr->data[WDTCSR] & (WDIE | WDE))
        avr_cycle_timer_register(board->avr, period(board), timed_out, board);
}

static uint8_t protected_bits(board_t *board, uint8_t value) {
    const uint8_t *data = board->avr->data;
    uint8_t guarded = WDP3 | WDP012;
    if (board->avr->cycle <= board->watchdog.change_until)
        return value & (guarded | WDE);
    return (data[WDTCSR] & (guarded | WDE)) | (value & WDE);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    uint8_t before = avr->data[address];
    uint8_t flag = before & (value & WDIF ? 0 : WDIF);
    bool opens = (value & WDCE) && (value & WDE);
    uint8_t now = flag | (value & WDIE) | protected_bits(board, value);
    if (avr->data[MCUSR] & WDRF)
        now |= WDE;
    board->watchdog.change_until = opens ? avr->cycle + CHANGE_WINDOW_CYCLES : 0;
    avr->data[address] = now;
    bool was_on = before & (WDIE | WDE), is_on = now & (WDIE | WDE);
    if (was_on != is_on || ((before ^ now) & (WDP3 | WDP012)))
        watchdog_kick(board);
}

static int wdr(avr_io_t *io, uint32_t control, void *param) {
    if (control != AVR_IOCTL_DEF('w', 'd', 't', 'r'))
        return -1;
    board_t *board = ((watchdog_t *)io)->board;
    if (!skips_run(board))
        watchdog_kick(board);
    return 0;
}

/* After a watchdog reset WDRF keeps it on, at its shortest period. */
void watchdog_reset(board_t *board) {
    board->avr->data[WDTCSR] = board->avr->data[MCUSR] & WDRF ? WDE : 0;
    board->watchdog.change_until = 0;
    watchdog_kick(board);
}

void watchdog_attach(board_t *board) {
    board->watchdog.board = board;
    board->watchdog.io.kind = "watchdog";
    board->watchdog.io.ioctl = wdr;
    avr_register_io(board->avr, &board->watchdog.io);
    board_on(board, WDTCSR, write_control, NULL, board);
}
