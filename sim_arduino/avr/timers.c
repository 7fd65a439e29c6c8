/* Timers with 8 bits and their PWM outputs, in all modes; those with 16 bits in their normal and CTC mode and in PWM
 * with 8 bits, CTC and fast PWM also with TOP in ICR, their outputs, and input capture.
 *
 * The counter is lazy: it catches up when a register is read or written, when an enabled interrupt is due, and at each
 * edge of an observed output. Whole rounds that passed meanwhile are counted in closed form, so PWM that is not
 * observed costs nothing. Source: data sheet, "8-bit Timer/Counter0 with PWM", "16-bit Timer/Counter1 with PWM" and
 * "8-bit Timer/Counter2".
 *
 * All happens when the counter leaves a value, as in the chapters' timing diagrams: a match sets its flag and acts on
 * its output; TOP ends a round and loads the compare registers from their buffers; TOV is set at MAX, in fast PWM at
 * TOP, in phase-correct PWM at BOTTOM. External clocks, the asynchronous timer 2, GTCCR, PRR, and in 16-bit timers FOC
 * are refused.
 */
#include "board.h"

#include <string.h>

enum { TOV = 0x01, OCFA = 0x02, OCF = 0x0E, ICF = 0x20 }; /* OCFA << 1 is OCFB; TIMSK has the same bits */
enum { CS = 0x07, WGM2 = 0x08, WGM13 = 0x10, ICES = 0x40, FOCA = 0x80, WGM10 = 0x03, PWM_MAX = 0xFF };
enum { COM_NONE, COM_TOGGLE, COM_CLEAR, COM_SET };
enum { KIND = 3, NORMAL = 0, PHASE_CORRECT = 1, CTC = 2, FAST = 3, TO_OCRA = 4, TO_ICR = 8 }; /* WGM: a kind, and TOP of PWM */
/* Rounds to TOP, or to MAX, after which all repeats; the least number of them of which whole rounds are counted at once. */
enum { SETTLED = 4, ROUNDS_FROM = 16 };
static const uint32_t NEVER = UINT32_MAX;

static bool is_wide(const timer_state_t *timer) { return timer->at->max > 0xFF; }
/* Number of compare units. */
static int units(const timer_state_t *timer) { return is_wide(timer) ? WIDE_UNITS : 2; }
static bool is_pwm(const timer_state_t *timer) { return timer->mode & PHASE_CORRECT; }
static bool is_dual_slope(const timer_state_t *timer) { return (timer->mode & KIND) == PHASE_CORRECT; }
static bool is_fast(const timer_state_t *timer) { return (timer->mode & KIND) == FAST; }

static uint16_t top_of(const timer_state_t *timer) {
    const uint8_t *icr = timer->board->avr->data + timer->at->icr;
    if (timer->mode & TO_ICR)
        return (uint16_t)(icr[0] | icr[1] << 8);
    if (is_pwm(timer))
        return timer->mode & TO_OCRA ? timer->compare[0] : PWM_MAX;
    return (timer->mode & KIND) == CTC ? timer->compare[0] : timer->at->max;
}

/* Counts in a round: from BOTTOM to BOTTOM. */
static uint32_t period(const timer_state_t *timer) {
    if (!is_dual_slope(timer))
        return timer->top + 1u;
    return timer->top ? 2u * timer->top : 1;
}

static uint64_t edges(const timer_state_t *timer, uint64_t cycle) { return (cycle - timer->origin) >> timer->shift; }
static uint64_t cycle_of(const timer_state_t *timer, uint64_t edge) { return timer->origin + (edge << timer->shift); }

/* ---- outputs */

static uint64_t high_at(const timer_output_t *output, uint64_t cycle) {
    return output->high_cycles + (output->driving && output->level ? cycle - output->high_from : 0);
}

static void count_high(timer_output_t *output, uint64_t cycle) {
    output->high_cycles = high_at(output, cycle);
    output->high_from = cycle;
}

static void set_driving(timer_output_t *output, bool driving, uint64_t cycle) {
    count_high(output, cycle);
    output->driving = driving;
}

static void act(timer_output_t *output, int com, uint64_t cycle) {
    bool level = com == COM_TOGGLE ? !output->level : com == COM_SET;
    if (com == COM_NONE || level == output->level)
        return;
    count_high(output, cycle);
    output->level = level;
}

static int opposite(int com) { return com == COM_CLEAR ? COM_SET : COM_CLEAR; }
static bool sets_or_clears(int com) { return com == COM_CLEAR || com == COM_SET; }

/* ---- the counter */

/* A counter above TOP, which has moved below it, counts on to MAX. */
static uint16_t last_of_round(const timer_state_t *timer) {
    return timer->count <= timer->top ? timer->top : timer->at->max;
}

static uint32_t single_slope_counts(const timer_state_t *timer, uint16_t value) {
    uint16_t last = last_of_round(timer);
    if (value >= timer->count)
        return value <= last ? value - timer->count + 1u : NEVER;
    return value <= timer->top ? last - timer->count + 1u + value + 1u : NEVER;
}

static uint32_t dual_slope_counts(const timer_state_t *timer, uint16_t value, bool downwards) {
    if (value > timer->top || value == (downwards ? 0 : timer->top))
        return NEVER;
    uint32_t round = period(timer), from = timer->down ? round - timer->count : timer->count;
    uint32_t to = downwards ? round - value : value;
    return (to + round - from) % round + 1;
}

/* Number of counts until the counter has left a value, and so set its flag. */
static uint32_t counts_to_leave(const timer_state_t *timer, uint16_t value) {
    if (!is_dual_slope(timer))
        return single_slope_counts(timer, value);
    uint32_t up = dual_slope_counts(timer, value, false), down = dual_slope_counts(timer, value, true);
    return up < down ? up : down;
}

static uint16_t overflow_value(const timer_state_t *timer) {
    if (is_dual_slope(timer))
        return 0;
    return is_fast(timer) ? last_of_round(timer) : timer->at->max;
}

/* Nothing but matches and ends of rounds lies ahead. */
static bool is_regular(const timer_state_t *timer) {
    bool beside_round = is_dual_slope(timer) && (timer->count > timer->top || !timer->top);
    return !timer->written && !beside_round;
}

static bool is_loaded(const timer_state_t *timer) {
    return !memcmp(timer->compare, timer->buffer, sizeof timer->compare);
}

static uint32_t least(uint32_t a, uint32_t b) { return a < b ? a : b; }

/* Number of counts to the next match or end of a slope. */
static uint32_t counts_to_event(const timer_state_t *timer) {
    if (!is_regular(timer))
        return 1;
    uint32_t first = counts_to_leave(timer, last_of_round(timer));
    for (int unit = 0; unit < units(timer); unit++)
        first = least(first, counts_to_leave(timer, timer->compare[unit]));
    return is_dual_slope(timer) ? least(first, counts_to_leave(timer, 0)) : first;
}

/* A write of TCNT blocks the match at the next count. */
static uint8_t match(timer_state_t *timer, uint64_t cycle) {
    uint8_t flags = 0;
    for (int unit = 0; unit < units(timer); unit++) {
        int com = timer->com[unit];
        if (timer->compare[unit] != timer->count || timer->written)
            continue;
        flags |= (uint8_t)(OCFA << unit);
        bool reversed = is_dual_slope(timer) && timer->down && sets_or_clears(com);
        act(&timer->output[unit], reversed ? opposite(com) : com, cycle);
    }
    timer->written = false;
    return flags;
}

static void load_compare(timer_state_t *timer) {
    memcpy(timer->compare, timer->buffer, sizeof timer->compare);
    timer->top = top_of(timer);
}

/* The compare registers are loaded from their buffers, and the outputs begin a round (fast PWM) or the second slope. */
static void begin_slope(timer_state_t *timer, uint64_t cycle) {
    load_compare(timer);
    for (int unit = 0; unit < units(timer); unit++) {
        int com = timer->com[unit];
        bool as_after_match = is_dual_slope(timer) && timer->compare[unit] < timer->top;
        if (sets_or_clears(com))
            act(&timer->output[unit], as_after_match ? com : opposite(com), cycle);
    }
}

static uint8_t count_single_slope(timer_state_t *timer, uint64_t cycle) {
    uint16_t last = last_of_round(timer);
    uint8_t flags = match(timer, cycle);
    if (timer->count == overflow_value(timer))
        flags |= TOV;
    if (timer->count++ != last)
        return flags;
    timer->count = 0;
    if (is_fast(timer))
        begin_slope(timer, cycle);
    return flags;
}

static uint8_t count_dual_slope(timer_state_t *timer, uint64_t cycle) {
    uint16_t left = timer->count;
    timer->down = left >= timer->top || (left && timer->down);
    uint8_t flags = match(timer, cycle);
    if (left >= timer->top)
        begin_slope(timer, cycle);
    if (!left)
        flags |= TOV;
    if (timer->down)
        timer->count = left ? left - 1 : 0;
    else
        timer->count = left + 1;
    return flags;
}

/* Counts this many edges; returns the flags that this sets. */
static uint8_t count_singly(timer_state_t *timer, uint64_t counts) {
    uint8_t flags = 0;
    while (counts) {
        uint32_t event = counts_to_event(timer), quiet = event > counts ? (uint32_t)counts : event - 1;
        timer->count = (uint16_t)(timer->down ? timer->count - quiet : timer->count + quiet);
        timer->counted += quiet;
        counts -= quiet;
        if (!counts)
            break;
        uint64_t cycle = cycle_of(timer, ++timer->counted);
        flags |= is_dual_slope(timer) ? count_dual_slope(timer, cycle) : count_single_slope(timer, cycle);
        counts--;
    }
    return flags;
}

/* Two rounds repeat exactly, also those of a toggled output: the time high of many is a multiple of theirs. */
static uint64_t count_rounds(timer_state_t *timer, uint64_t counts) {
    uint32_t two = 2 * period(timer);
    uint64_t before[WIDE_UNITS], times = counts / two - 1;
    for (int unit = 0; unit < units(timer); unit++)
        before[unit] = high_at(&timer->output[unit], cycle_of(timer, timer->counted));
    count_singly(timer, two);
    for (int unit = 0; unit < units(timer); unit++) {
        timer_output_t *output = &timer->output[unit];
        output->high_cycles += times * (high_at(output, cycle_of(timer, timer->counted)) - before[unit]);
        output->high_from += (times * two) << timer->shift;
    }
    timer->counted += times * two;
    return counts - (times + 1) * two;
}

/* Lets the counter catch up with `cycle`. */
static void count_to(timer_state_t *timer, uint64_t cycle) {
    uint8_t *data = timer->board->avr->data, flags = 0;
    uint64_t now = timer->shift < 0 ? 0 : edges(timer, cycle);
    if (now <= timer->counted)
        return;
    bool keeps_top = is_loaded(timer) && timer->count <= timer->top;
    uint64_t counts = now - timer->counted, round = (keeps_top ? timer->top : timer->at->max) + 1u;
    if (counts >= ROUNDS_FROM * round) {
        flags |= count_singly(timer, SETTLED * round);
        counts = count_rounds(timer, counts - SETTLED * round);
    }
    flags |= count_singly(timer, counts);
    data[timer->at->tifr] |= flags;
    if (flags & data[timer->at->timsk])
        board_recheck(timer->board);
}

/* ---- events */

static bool is_observed(const timer_state_t *timer) {
    for (int unit = 0; unit < units(timer); unit++)
        if (timer->output[unit].driving && pins_is_observed(timer->board, timer->at->output[unit]))
            return true;
    return false;
}

/* Number of counts to the next one that must not wait. */
static uint32_t counts_to_alarm(const timer_state_t *timer) {
    uint8_t enabled = timer->board->avr->data[timer->at->timsk] & (TOV | OCF);
    bool observed = is_observed(timer);
    if (!enabled && !observed)
        return NEVER;
    if (observed || !is_regular(timer) || !is_loaded(timer))
        return counts_to_event(timer);
    uint32_t first = enabled & TOV ? counts_to_leave(timer, overflow_value(timer)) : NEVER;
    for (int unit = 0; unit < units(timer); unit++)
        if (enabled & OCFA << unit)
            first = least(first, counts_to_leave(timer, timer->compare[unit]));
    return first;
}

static avr_cycle_count_t alarm_cycle(const timer_state_t *timer) {
    uint32_t counts = timer->shift < 0 ? NEVER : counts_to_alarm(timer);
    return counts == NEVER ? 0 : cycle_of(timer, timer->counted + counts);
}

static void show_outputs(const timer_state_t *timer, uint64_t cycle) {
    for (int unit = 0; unit < units(timer); unit++)
        if (timer->output[unit].driving)
            pins_compare(timer->board, timer->at->output[unit].port, cycle);
}

static avr_cycle_count_t alarm(avr_t *avr, avr_cycle_count_t when, void *param) {
    timer_state_t *timer = param;
    count_to(timer, when);
    if (is_observed(timer))
        show_outputs(timer, when);
    return alarm_cycle(timer);
}

/* Plans the next event after the counter or a setting has changed. */
static void plan(timer_state_t *timer) {
    avr_t *avr = timer->board->avr;
    avr_cycle_timer_cancel(avr, alarm, timer);
    avr_cycle_count_t when = alarm_cycle(timer);
    if (when)
        avr_cycle_timer_register(avr, when - avr->cycle, alarm, timer);
}

/* ---- what the pins ask */

static bool drives(const timer_state_t *timer, int unit) {
    chip_pin_t pin = timer->at->output[unit];
    return timer->com[unit] && (timer->board->avr->data[CHIP_PORTS[pin.port].ddr] >> pin.bit & 1);
}

/* The pins' directions, or the set of observed pins, have changed. */
void timers_pins_changed(board_t *board) {
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++) {
        count_to(timer, board->avr->cycle);
        for (int unit = 0; unit < units(timer); unit++)
            set_driving(&timer->output[unit], drives(timer, unit), board->avr->cycle);
        plan(timer);
    }
}

/* Levels of a port's pins that timers drive, at a cycle. */
uint8_t timers_levels(board_t *board, int port, uint64_t cycle) {
    uint8_t levels = 0;
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++)
        for (int unit = 0; unit < units(timer); unit++) {
            if (timer->at->output[unit].port != port || !timer->com[unit])
                continue;
            count_to(timer, cycle);
            levels |= (uint8_t)(timer->output[unit].level << timer->at->output[unit].bit);
        }
    return levels;
}

/* Cycles since power-up for which a timer drove the pin high. */
uint64_t timers_high_cycles(board_t *board, int port, int bit) {
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++)
        for (int unit = 0; unit < units(timer); unit++)
            if (timer->at->output[unit].port == port && timer->at->output[unit].bit == bit) {
                count_to(timer, board->avr->cycle);
                return high_at(&timer->output[unit], board->avr->cycle);
            }
    return 0;
}

/* ---- registers */

static uint8_t com_of(const timer_state_t *timer, int unit) {
    uint8_t com = timer->board->avr->data[timer->at->tccra] >> (6 - 2 * unit) & 3;
    if (com && timer->at->output[unit].port == PORTS) {
        board_refuse(timer->board, "the output of compare unit %c of a timer is used, but not simulated", 'A' + unit);
        return COM_NONE;
    }
    bool toggles_in_pwm = unit == 0 && (timer->mode & TO_OCRA);
    return is_pwm(timer) && com == COM_TOGGLE && !toggles_in_pwm ? COM_NONE : com;
}

/* Outside PWM a write of a compare register takes effect at once. */
static void load_unbuffered(timer_state_t *timer) {
    if (!is_pwm(timer))
        load_compare(timer);
    timer->top = top_of(timer);
}

static uint8_t wide_mode_of(const timer_state_t *timer, uint8_t a, uint8_t b) {
    uint8_t wgm = (uint8_t)((a & WGM10) | (b & (WGM2 | WGM13)) >> 1);
    switch (wgm) {
    case 0: return NORMAL;
    case 1: return PHASE_CORRECT;
    case 4: return CTC;
    case 5: return FAST;
    case 12: return CTC | TO_ICR;
    case 14: return FAST | TO_ICR;
    }
    board_refuse(timer->board, "WGM of a 16-bit timer is %d, but only 0, 1, 4, 5, 12 and 14 are simulated", wgm);
    return NORMAL;
}

static uint8_t mode_of(const timer_state_t *timer, uint8_t a, uint8_t b) {
    return is_wide(timer) ? wide_mode_of(timer, a, b) : (uint8_t)((a & WGM10) | (b & WGM2 ? TO_OCRA : 0));
}

static void configure(timer_state_t *timer) {
    board_t *board = timer->board;
    const uint8_t *data = board->avr->data;
    uint16_t divider = timer->at->dividers[data[timer->at->tccrb] & CS];
    timer->mode = mode_of(timer, data[timer->at->tccra], data[timer->at->tccrb]);
    if (!divider && (data[timer->at->tccrb] & CS))
        board_refuse(board, "CS of a timer is %d, but external clocks are not simulated", data[timer->at->tccrb] & CS);
    timer->shift = divider ? __builtin_ctz(divider) : -1;
    timer->counted = divider ? edges(timer, board->avr->cycle) : 0;
    timer->down = timer->down && is_dual_slope(timer);
    load_unbuffered(timer);
    for (int unit = 0; unit < units(timer); unit++) {
        uint8_t before = timer->com[unit];
        timer->com[unit] = com_of(timer, unit);
        set_driving(&timer->output[unit], drives(timer, unit), board->avr->cycle);
        if (!before != !timer->com[unit])
            pins_connect(board, timer->at->output[unit], timer->com[unit]);
    }
    plan(timer);
}

/* A register that must stay 0. */
static void write_refused(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    if (value)
        board_refuse(param, "the register at 0x%02x is written, but not simulated", address);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    count_to(param, avr->cycle);
    avr->data[address] = value;
    configure(param);
}

/* FOC acts as a match does, without its flag. */
static void write_control_with_force(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    timer_state_t *timer = param;
    count_to(timer, avr->cycle);
    avr->data[address] = value & (CS | WGM2);
    configure(timer);
    for (int unit = 0; unit < units(timer); unit++)
        if ((value & FOCA >> unit) && !is_pwm(timer))
            act(&timer->output[unit], timer->com[unit], avr->cycle);
    show_outputs(timer, avr->cycle);
}

static void write_enables(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    count_to(param, avr->cycle);
    avr->data[address] = value;
    plan(param);
}

static void write_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    count_to(param, avr->cycle);
    board_clear_flags(avr, address, value, param);
}

static uint8_t read_flags(avr_t *avr, avr_io_addr_t address, void *param) {
    count_to(param, avr->cycle);
    return avr->data[address];
}

/* ---- count, compare registers and capture */

/* Registers with 16 bits share one byte for the high half: writes put it there first, reads find it there afterwards. */
static uint16_t word_of(const timer_state_t *timer, uint8_t low) {
    return (uint16_t)(is_wide(timer) ? timer->high << 8 | low : low);
}

static void write_high(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    ((timer_state_t *)param)->high = value;
}

static uint8_t read_high(avr_t *avr, avr_io_addr_t address, void *param) {
    return ((timer_state_t *)param)->high;
}

static void write_count(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    timer_state_t *timer = param;
    count_to(timer, avr->cycle);
    avr->data[address] = value;
    timer->count = word_of(timer, value);
    timer->written = !is_wide(timer);
    plan(timer);
}

static void write_compare(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    timer_state_t *timer = param;
    count_to(timer, avr->cycle);
    avr->data[address] = value;
    if (is_wide(timer))
        avr->data[address + 1] = timer->high;
    int unit = 0;
    while (timer->at->ocr[unit] != address)
        unit++;
    timer->buffer[unit] = word_of(timer, value);
    load_unbuffered(timer);
    plan(timer);
}

static uint8_t read_count(avr_t *avr, avr_io_addr_t address, void *param) {
    timer_state_t *timer = param;
    count_to(timer, avr->cycle);
    timer->high = (uint8_t)(timer->count >> 8);
    return (uint8_t)timer->count;
}

static uint8_t read_capture(avr_t *avr, avr_io_addr_t address, void *param) {
    ((timer_state_t *)param)->high = avr->data[address + 1];
    return avr->data[address];
}

/* A new TOP holds at once; in other modes ICR cannot be written. */
static void write_top(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    timer_state_t *timer = param;
    if (!(timer->mode & TO_ICR)) {
        board_refuse(timer->board, "ICR of a timer is written in mode %d, but it is not its TOP", timer->mode);
        return;
    }
    count_to(timer, avr->cycle);
    avr->data[address] = value;
    avr->data[address + 1] = timer->high;
    timer->top = top_of(timer);
    plan(timer);
}

static void capture(timer_state_t *timer, uint64_t cycle) {
    uint8_t *data = timer->board->avr->data;
    count_to(timer, cycle);
    data[timer->at->icr] = (uint8_t)timer->count;
    data[timer->at->icr + 1] = (uint8_t)(timer->count >> 8);
    data[timer->at->tifr] |= ICF;
    board_recheck(timer->board);
}

/* Pins of a port have changed at `cycle`, perhaps in the middle of the last instruction. */
void timers_capture(board_t *board, int port, uint8_t changed, uint8_t level, uint64_t cycle) {
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++) {
        chip_pin_t pin = timer->at->capture;
        bool rises = board->avr->data[timer->at->tccrb] & ICES;
        if (!(timer->mode & TO_ICR) && pin.port == port && (changed >> pin.bit & 1) && (level >> pin.bit & 1) == rises)
            capture(timer, cycle);
    }
}

/* ---- life */

/* A reset begins: the outputs drive nothing any more. */
void timers_release(board_t *board) {
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++) {
        count_to(timer, board->avr->cycle);
        for (int unit = 0; unit < units(timer); unit++)
            set_driving(&timer->output[unit], false, board->avr->cycle);
    }
}

void timers_reset(board_t *board) {
    for (int i = 0; i < TIMERS; i++) {
        timer_state_t *timer = &board->timers[i], after = {.board = board, .at = &CHIP_TIMERS[i], .shift = -1};
        after.origin = board->avr->cycle;
        after.top = after.at->max;
        for (int unit = 0; unit < WIDE_UNITS; unit++)
            after.output[unit].high_cycles = timer->output[unit].high_cycles;
        *timer = after;
    }
}

static void attach_high_bytes(timer_state_t *timer) {
    board_t *board = timer->board;
    board_on(board, timer->at->tcnt + 1, write_high, read_high, timer);
    for (int unit = 0; unit < WIDE_UNITS; unit++)
        board_on(board, timer->at->ocr[unit] + 1, write_high, NULL, timer);
    board_on(board, timer->at->tccra + 2, write_refused, NULL, board);
    board_on(board, timer->at->icr, write_top, read_capture, timer);
    board_on(board, timer->at->icr + 1, write_high, read_high, timer);
}

void timers_attach(board_t *board) {
    const uint16_t refused[] = {GTCCR, PRR0, PRR1, ASSR};
    for (int i = 0; i < 4; i++)
        board_on(board, refused[i], write_refused, NULL, board);
    timers_reset(board);
    for (timer_state_t *timer = board->timers; timer < board->timers + TIMERS; timer++) {
        const chip_timer_t *at = timer->at;
        board_on(board, at->tccra, write_control, NULL, timer);
        board_on(board, at->tccrb, is_wide(timer) ? write_control : write_control_with_force, NULL, timer);
        board_on(board, at->timsk, write_enables, NULL, timer);
        board_on(board, at->tifr, write_flags, read_flags, timer);
        board_on(board, at->tcnt, write_count, read_count, timer);
        for (int unit = 0; unit < units(timer); unit++)
            board_on(board, at->ocr[unit], write_compare, NULL, timer);
        if (is_wide(timer))
            attach_high_bytes(timer);
    }
}
