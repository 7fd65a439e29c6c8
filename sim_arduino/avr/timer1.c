/* Timer 1, whose counter goes on when a compare register is written (the core's timers start again).
 *
 * Normal and CTC mode, prescaler, both compare units, overflow, and input capture on ICP1. The PWM modes count as the
 * normal mode does; their outputs are not simulated. The prescaler runs from the reset on, whatever the timer does.
 */
#include "peripherals.h"

enum { TIFR1_ = 0x36, TIMSK1_ = 0x6F, TCCR1A_ = 0x80, TCCR1B_ = 0x81, TCNT1L_ = 0x84, TCNT1H_ = 0x85, ICR1L_ = 0x86,
       ICR1H_ = 0x87, OCR1AL_ = 0x88, OCR1AH_ = 0x89, OCR1BL_ = 0x8A, OCR1BH_ = 0x8B };
enum { TOV1 = 0x01, OCF1A = 0x02, OCF1B = 0x04, ICF1 = 0x20 };
enum { CS1 = 0x07, WGM12 = 0x08, WGM13 = 0x10, ICES1 = 0x40, WGM11_10 = 0x03 };
enum { MAX = 0xFFFF, NEVER = 0x10001 };

static const uint16_t dividers[8] = {0, 1, 8, 64, 256, 1024, 0, 0}; /* no external clock */

static bool clears_on_compare(const uint8_t *data) {
    return !(data[TCCR1A_] & WGM11_10) && (data[TCCR1B_] & (WGM12 | WGM13)) == WGM12;
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
    board->avr->data[TIFR1_] |= flags;
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
    timer1_t *timer = &board->timer1;
    const uint8_t *data = board->avr->data;
    timer->divider = dividers[data[TCCR1B_] & CS1];
    timer->top = clears_on_compare(data) ? timer->compare[0] : MAX;
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

static void write_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)param;
    avr->data[address] &= (uint8_t)~value;
}

/* The 16-bit registers share one byte for the high half: writes put it there first, reads find it there afterwards. */
static void write_high(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)avr, (void)address;
    ((board_t *)param)->timer1.high = value;
}

static void write_low(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    timer1_t *timer = &board->timer1;
    uint16_t word = (uint16_t)(timer->high << 8 | value);
    count_to(board, avr->cycle);
    avr->data[address] = value;
    avr->data[address + 1] = timer->high;
    if (address == TCNT1L_)
        timer->count = word;
    else
        timer->compare[address == OCR1BL_] = word;
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
    ((board_t *)param)->timer1.high = avr->data[ICR1H_];
    return avr->data[address];
}

/* The level of ICP1 has changed at `cycle`, perhaps in the middle of the last instruction. */
void timer1_capture(board_t *board, bool rose, uint64_t cycle) {
    uint8_t *data = board->avr->data;
    if (rose != !!(data[TCCR1B_] & ICES1))
        return;
    count_to(board, cycle);
    data[ICR1L_] = (uint8_t)board->timer1.count;
    data[ICR1H_] = (uint8_t)(board->timer1.count >> 8);
    data[TIFR1_] |= ICF1;
    board_recheck(board);
}

/* ---- life ---- */

void timer1_reset(board_t *board) {
    board->timer1 = (timer1_t){.origin = board->avr->cycle};
    plan(board);
}

void timer1_attach(board_t *board) {
    static const int lows[] = {TCNT1L_, OCR1AL_, OCR1BL_};
    for (size_t i = 0; i < sizeof lows / sizeof *lows; i++) {
        board_on_write(board, lows[i], write_low);
        board_on_write(board, lows[i] + 1, write_high);
    }
    board_on_write(board, TCCR1A_, write_control);
    board_on_write(board, TCCR1B_, write_control);
    board_on_write(board, TIFR1_, write_flags);
    board_on_write(board, TIMSK1_, NULL);
    board_on_read(board, TCNT1L_, read_count);
    board_on_read(board, TCNT1H_, read_high);
    board_on_read(board, ICR1L_, read_capture);
    board_on_read(board, ICR1H_, read_high);
}
