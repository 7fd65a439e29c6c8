/* Timer 1, whose counter goes on when a compare register is written (the core's timers start again).
 *
 * Normal and CTC mode, prescaler, both compare units, overflow, and input capture on ICP1. The PWM modes count as the
 * normal mode does; their outputs are not simulated. The prescaler runs from the reset on, whatever the timer does.
 */
#include "peripherals.h"

enum { TOV1 = 0x01, OCF1A = 0x02, OCF1B = 0x04, ICF1 = 0x20 };
enum { CS1 = 0x07, WGM12 = 0x08, WGM13 = 0x10, ICES1 = 0x40, WGM11_10 = 0x03 };
enum { MAX = 0xFFFF, NEVER = 0x10001 };

static bool clears_on_compare(const board_t *board) {
    const chip_timer16_t *at = &board->chip->timer1;
    const uint8_t *data = board->avr->data;
    return !(data[at->tccra] & WGM11_10) && (data[at->tccrb] & (WGM12 | WGM13)) == WGM12;
}

/* Edges that the prescaler has given from the reset to `cycle`. */
static uint64_t edges(const timer1_t *timer, uint64_t cycle) { return (cycle - timer->origin) / timer->divider; }

/* Number of edges until the counter leaves the value `at`, which is when its flag is set. */
static uint32_t edges_to_leave(const timer1_t *timer, uint32_t at) {
    uint32_t top = timer->count <= timer->top ? timer->top : MAX;
    if (at >= timer->count)
        return at <= top ? at - timer->count + 1 : NEVER;
    return at <= timer->top ? top - timer->count + 1 + at + 1 : NEVER;
}

/* Moves the counter on by at most as many edges as there are to the next event. */
static void advance(timer1_t *timer, uint32_t passed) {
    uint32_t to_zero = edges_to_leave(timer, timer->count <= timer->top ? timer->top : MAX);
    timer->count = passed < to_zero ? timer->count + passed : 0;
    timer->counted += passed;
}

static uint32_t next_event(const timer1_t *timer) {
    uint32_t a = edges_to_leave(timer, timer->compare[0]), b = edges_to_leave(timer, timer->compare[1]);
    uint32_t overflow = edges_to_leave(timer, MAX), first = a < b ? a : b;
    return first < overflow ? first : overflow;
}

static uint64_t next_event_cycle(const timer1_t *timer) {
    return timer->origin + (timer->counted + next_event(timer)) * timer->divider;
}

static void pass_event(board_t *board) {
    const chip_timer16_t *at = &board->chip->timer1;
    timer1_t *timer = &board->timer1;
    uint32_t passed = next_event(timer);
    uint8_t flags = 0;
    if (edges_to_leave(timer, timer->compare[0]) == passed)
        flags |= OCF1A;
    if (edges_to_leave(timer, timer->compare[1]) == passed)
        flags |= OCF1B;
    if (edges_to_leave(timer, MAX) == passed)
        flags |= TOV1;
    advance(timer, passed);
    board->avr->data[at->tifr] |= flags;
    board_recheck(board);
}

/* Lets the counter catch up with `cycle`. */
static void count_to(board_t *board, uint64_t cycle) {
    timer1_t *timer = &board->timer1;
    if (!timer->divider)
        return;
    while (next_event_cycle(timer) <= cycle)
        pass_event(board);
    uint64_t now = edges(timer, cycle);
    if (now > timer->counted)
        advance(timer, (uint32_t)(now - timer->counted));
}

static avr_cycle_count_t event(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)when;
    board_t *board = param;
    count_to(board, avr->cycle);
    return next_event_cycle(&board->timer1);
}

/* Plans the next event after the counter or a setting has changed. */
static void plan(board_t *board) {
    const chip_timer16_t *at = &board->chip->timer1;
    timer1_t *timer = &board->timer1;
    const uint8_t *data = board->avr->data;
    timer->divider = at->dividers[data[at->tccrb] & CS1];
    timer->top = clears_on_compare(board) ? timer->compare[0] : MAX;
    avr_cycle_timer_cancel(board->avr, event, board);
    if (!timer->divider)
        return;
    timer->counted = edges(timer, board->avr->cycle);
    avr_cycle_timer_register(board->avr, next_event_cycle(timer) - board->avr->cycle, event, board);
}

/* ---- registers ---- */

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    count_to(board, avr->cycle);
    avr->data[address] = value;
    plan(board);
}

/* The 16-bit registers share one byte for the high half: writes put it there first, reads find it there afterwards. */
static void write_high(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)avr, (void)address;
    ((board_t *)param)->timer1.high = value;
}

static void write_low(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    const chip_timer16_t *at = &board->chip->timer1;
    timer1_t *timer = &board->timer1;
    uint16_t word = (uint16_t)(timer->high << 8 | value);
    count_to(board, avr->cycle);
    avr->data[address] = value;
    avr->data[address + 1] = timer->high;
    if (address == at->tcnt)
        timer->count = word;
    else
        timer->compare[address == at->ocr[1]] = word;
    plan(board);
}

static uint8_t read_high(avr_t *avr, avr_io_addr_t address, void *param) {
    (void)avr, (void)address;
    return ((board_t *)param)->timer1.high;
}

static uint8_t read_count(avr_t *avr, avr_io_addr_t address, void *param) {
    (void)address;
    board_t *board = param;
    timer1_t *timer = &board->timer1;
    count_to(board, avr->cycle);
    timer->high = (uint8_t)(timer->count >> 8);
    return (uint8_t)timer->count;
}

static uint8_t read_capture(avr_t *avr, avr_io_addr_t address, void *param) {
    board_t *board = param;
    board->timer1.high = avr->data[board->chip->timer1.icr + 1];
    return avr->data[address];
}

/* The level of ICP1 has changed at `cycle`, perhaps in the middle of the last instruction. */
void timer1_capture(board_t *board, bool rose, uint64_t cycle) {
    const chip_timer16_t *at = &board->chip->timer1;
    uint8_t *data = board->avr->data;
    if (rose != !!(data[at->tccrb] & ICES1))
        return;
    count_to(board, cycle);
    data[at->icr] = (uint8_t)board->timer1.count;
    data[at->icr + 1] = (uint8_t)(board->timer1.count >> 8);
    data[at->tifr] |= ICF1;
    board_recheck(board);
}

/* ---- life ---- */

void timer1_reset(board_t *board) {
    board->timer1 = (timer1_t){.origin = board->avr->cycle};
    plan(board);
}

void timer1_attach(board_t *board) {
    const chip_timer16_t *at = &board->chip->timer1;
    const int lows[] = {at->tcnt, at->ocr[0], at->ocr[1]};
    for (size_t i = 0; i < sizeof lows / sizeof *lows; i++) {
        board_on_write(board, lows[i], write_low);
        board_on_write(board, lows[i] + 1, write_high);
    }
    board_on_write(board, at->tccra, write_control);
    board_on_write(board, at->tccrb, write_control);
    board_on_write(board, at->tifr, board_clear_flags);
    board_on_write(board, at->timsk, NULL);
    board_on_read(board, at->tcnt, read_count);
    board_on_read(board, at->tcnt + 1, read_high);
    board_on_read(board, at->icr, read_capture);
    board_on_read(board, at->icr + 1, read_high);
}
