/* The board's life: creation, run loop, interrupts, resets. */
#include "board.h"

#include <simavr/sim_core.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DATA_SPACE = 0x10000 };
enum { SE_BIT = 0x01, SM_BITS = 0x0E };
enum { PORF_BIT = 0, EXTRF_BIT = 1, BORF_BIT = 2, WDRF_BIT = 3 };

static char last_message[256];

static void keep_message(avr_t *avr, const int level, const char *format, va_list arguments) {
    if (level <= LOG_WARNING)
        vsnprintf(last_message, sizeof last_message, format, arguments);
}

/* ---- interrupts ---- */

/* Enable and flag bits decide at any moment; a register that holds them is watched. */
static void watch_register(board_t *board, int address) {
    if (!address || board->wrapped[address].board)
        return;
    wrapped_t *wrapped = &board->wrapped[address];
    *wrapped = (wrapped_t){board, board->avr->io[address - 32].w.c, board->avr->io[address - 32].w.param};
    board->avr->io[address - 32].w.c = board_write_and_recheck;
    board->avr->io[address - 32].w.param = wrapped;
}

/* Pin changes: the core's table for the ATmega2560 lacks two of them. */
static void add_vectors(board_t *board) {
    for (int group = 0; group < CHANGE_GROUPS; group++) {
        avr_int_vector_t *vector = &board->changes[group];
        vector->vector = (uint8_t)(CHANGE_VECTOR + group);
        vector->enable = (avr_regbit_t)AVR_IO_REGBIT(PCICR, group);
        vector->raised = (avr_regbit_t)AVR_IO_REGBIT(PCIFR, group);
        avr_register_vector(board->avr, vector);
    }
}

/* The flag of these stays until its cause is gone. */
static void set_levels(board_t *board) {
    board->vector[TWI_VECTOR]->raise_sticky = 1;
    for (int i = 0; i < USARTS; i++)
        for (int number = 0; number < 2; number++)
            board->vector[CHIP_USARTS[i].rx_vector + number]->raise_sticky = 1;
}

static void collect_vectors(board_t *board) {
    add_vectors(board);
    avr_int_table_t *table = &board->avr->interrupts;
    for (int i = 0; i < table->vector_count; i++) {
        avr_int_vector_t *vector = table->vector[i];
        if (vector->vector < VECTORS)
            board->vector[vector->vector] = vector;
        watch_register(board, vector->enable.reg);
        watch_register(board, vector->raised.reg);
    }
    set_levels(board);
    board->flagless = 1ull << EEPROM_VECTOR;
    for (int i = 0; i < EXTERNALS; i++)
        board->flagless |= 1ull << (EXTERNAL_VECTOR + i);
}

/* An idle EEPROM, and external interrupts at a low level, request an interrupt as long as this lasts, without a flag. */
static bool is_requested(board_t *board, avr_int_vector_t *vector) {
    if (vector->vector == EEPROM_VECTOR)
        return eeprom_is_ready(board);
    return avr_regbit_get(board->avr, vector->raised) || pin_interrupts_level_requests(board, vector->vector);
}

static bool is_wanted(board_t *board, avr_int_vector_t *vector) {
    avr_t *avr = board->avr;
    if (!vector || !avr_regbit_get(avr, vector->enable))
        return false;
    if (board->flagless >> vector->vector & 1)
        return is_requested(board, vector);
    return vector->raised.reg ? avr_regbit_get(avr, vector->raised) : vector->pending;
}

static avr_int_vector_t *most_urgent(board_t *board) {
    for (int number = 1; number < VECTORS; number++)
        if (is_wanted(board, board->vector[number]))
            return board->vector[number];
    return NULL;
}

static void enter(board_t *board, avr_int_vector_t *vector) {
    avr_t *avr = board->avr;
    avr->cycle += INTERRUPT_CYCLES;
    if (board->asleep)
        avr->cycle += INTERRUPT_CYCLES;
    board->asleep = false;
    _avr_push_addr(avr, avr->pc);
    avr->sreg[S_I] = 0;
    avr->pc = vector->vector * avr->vector_size;
    uint8_t control = avr->data[WDTCSR];
    avr_clear_interrupt(avr, vector);
    if (vector->vector == WATCHDOG_VECTOR)
        avr->data[WDTCSR] = watchdog_served(control);
}

/* After SEI and RETI one more instruction runs before an interrupt: the core sets -2 there. */
static void serve_interrupts(board_t *board) {
    avr_t *avr = board->avr;
    if (avr->interrupt_state < -1) {
        avr->interrupt_state = -1;
        return;
    }
    avr->interrupt_state = 0;
    avr->interrupts.pending.read = avr->interrupts.pending.write;
    if (!avr->sreg[S_I])
        return;
    avr_int_vector_t *vector = most_urgent(board);
    if (vector)
        enter(board, vector);
}

/* ---- run loop ---- */

static avr_cycle_count_t slice_end(avr_t *avr, avr_cycle_count_t when, void *param) {
    return 0;
}

/* The core returns from its instructions at its next event: here the end of the slice, which a reset forgets. */
static void arm_slice_end(board_t *board) {
    avr_t *avr = board->avr;
    if (avr->cycle < board->run_until)
        avr_cycle_timer_register(avr, board->run_until - avr->cycle, slice_end, board);
}

static void reset_now(board_t *board, uint8_t cause, uint64_t until);

/* SLEEP does nothing unless SE is set. Of the modes only idle is simulated: it stops the CPU and nothing else. */
static void fall_asleep(board_t *board) {
    avr_t *avr = board->avr;
    uint8_t control = avr->data[SMCR];
    avr->state = cpu_Running; /* the core would wake for interrupts that are not served */
    board->asleep = control & SE_BIT;
    if (board->asleep && (control & SM_BITS))
        board_refuse(board, "SMCR is 0x%02x, but only idle mode is simulated", control);
}

/* The cycle of the next event of a timer or peripheral. */
static uint64_t next_timer(const avr_t *avr) {
    return avr->cycle_timers.timer ? avr->cycle_timers.timer->when : UINT64_MAX;
}

/* Runs instructions to the next event or to a write that may enable an interrupt. The core does not count the cycles of
 * such a write, nor those of an interrupt's entry, so each call sets the number of cycles to the event. */
static void run_instructions(board_t *board) {
    avr_t *avr = board->avr;
    uint64_t event = next_timer(avr);
    avr->run_cycle_count = event > avr->cycle ? event - avr->cycle : 1;
    avr_flashaddr_t at = avr->pc, next = avr_run_one(avr);
    if (avr->state == cpu_Sleeping)
        fall_asleep(board);
    if (avr->state != cpu_Running)
        board->crash_pc = at;
    avr->pc = next + 2 * board->skipped;
    avr->cycle += board->skipped;
    board->skipped = 0;
}

static void sleep_on(board_t *board) {
    avr_t *avr = board->avr;
    uint64_t event = next_timer(avr), until = event < board->run_until ? event : board->run_until;
    if (until <= avr->cycle)
        return;
    board->slept += until - avr->cycle;
    avr->cycle = until;
}

static void run_some(board_t *board) {
    avr_t *avr = board->avr;
    if (board->asleep)
        sleep_on(board);
    else
        run_instructions(board);
    if (next_timer(avr) <= avr->cycle)
        avr_cycle_timer_process(avr);
    if (board->reset_wanted)
        reset_now(board, 1 << WDRF_BIT, avr->cycle);
    else if (avr->interrupt_state)
        serve_interrupts(board);
}

/* Runs to the first instruction boundary at or after `target`. */
EXPORT int mrl_run_until(board_t *board, uint64_t target) {
    avr_t *avr = board->avr;
    avr_global_logger_set(keep_message); /* that of another chip's library may be set */
    board->stop = false;
    board->run_until = target;
    arm_slice_end(board);
    while (avr->cycle < target && !board->stop && avr->state == cpu_Running)
        run_some(board);
    board->run_until = 0;
    avr_cycle_timer_cancel(avr, slice_end, board);
    if (avr->state != cpu_Running)
        return RUN_CRASHED;
    return board->stop ? RUN_STOPPED : RUN_DONE;
}

/* The CPU stands still until `target`, while the peripherals run on. A program hangs while it runs: if it sleeps, its
 * last kick of the watchdog counts as given now. */
EXPORT void mrl_stall_until(board_t *board, uint64_t target) {
    if (board->asleep)
        watchdog_kick(board);
    if (board->avr->cycle < target)
        board->avr->cycle = target;
}

/* ---- resets ---- */

/* The chip is held in reset until a cycle: its pins float and its clock stands. */
static void reset_now(board_t *board, uint8_t cause, uint64_t until) {
    avr_t *avr = board->avr;
    uint8_t flags = (uint8_t)((avr->data[MCUSR] | cause) & 0x0F);
    pins_release(board);
    avr_reset(avr);
    avr->cycle = until;
    avr->run_cycle_limit = avr->frequency; /* a reset sets 1: control back after every instruction */
    avr->data[MCUSR] = board->reset_flags < 0 ? flags : (uint8_t)board->reset_flags;
    board->reset_wanted = board->asleep = false;
    board->resets++;
    usarts_reset(board);
    twi_reset(board);
    watchdog_reset(board);
    adc_reset(board);
    timers_reset(board);
    pins_reset(board);
    arm_slice_end(board);
}

/* Reset line (DTR): SRAM keeps its contents. */
EXPORT void mrl_reset(board_t *board) {
    reset_now(board, 1 << EXTRF_BIT, board->avr->cycle);
}

/* The supply has dipped below the brown-out level, until a cycle: SRAM keeps its contents. */
EXPORT void mrl_brown_out(board_t *board, uint64_t until) {
    uint64_t now = board->avr->cycle;
    reset_now(board, 1 << BORF_BIT, until > now ? until : now);
}

/* Power comes back: SRAM and registers hold the bytes of `pattern`, from address 0 to `mrl_ram_end`. */
EXPORT void mrl_power_cycle(board_t *board, const uint8_t *pattern) {
    avr_t *avr = board->avr;
    memcpy(avr->data, pattern, (size_t)avr->ramend + 1);
    memset(avr->data + 32, 0, (size_t)avr->ioend + 1 - 32);
    reset_now(board, 1 << PORF_BIT, avr->cycle);
    if (board->reset_flags < 0)
        avr->data[MCUSR] = 1 << PORF_BIT;
}

/* MCUSR as every following start shows it; -1 = as the chip does (a bootloader clears it: 0). */
EXPORT void mrl_set_reset_flags(board_t *board, int flags) {
    board->reset_flags = flags;
}

/* ---- creation ---- */

/* A stray write goes through before the core reports it; give it all of the 16-bit space to land in. */
static bool widen_data_space(avr_t *avr) {
    uint8_t *data = calloc(1, DATA_SPACE);
    if (!data)
        return false;
    memcpy(data, avr->data, (size_t)avr->ramend + 1);
    free(avr->data);
    avr->data = data;
    return true;
}

EXPORT board_t *mrl_create(uint32_t frequency_hz, const hooks_t *hooks) {
    avr_global_logger_set(keep_message);
    board_t *board = calloc(1, sizeof *board);
    avr_t *avr = board ? avr_make_mcu_by_name(CHIP_NAME) : NULL;
    if (!avr)
        return NULL;
    avr_init(avr);
    if (!widen_data_space(avr))
        return NULL;
    avr->frequency = frequency_hz;
    avr->log = LOG_WARNING;
    board->avr = avr;
    board->hooks = *hooks;
    board->reset_flags = -1;
    usarts_attach(board);
    twi_attach(board);
    watchdog_attach(board);
    adc_attach(board);
    timers_attach(board);
    eeprom_attach(board);
    pins_attach(board);
    pin_interrupts_attach(board);
    collect_vectors(board);
    return board;
}

EXPORT void mrl_load(board_t *board, uint8_t *code, uint32_t size, uint32_t address) {
    avr_loadcode(board->avr, code, size, address);
    if (board->avr->codeend < address + size)
        board->avr->codeend = address + size;
    skips_find(board, address, address + size);
}

EXPORT void mrl_destroy(board_t *board) {
    for (int i = 0; i < USARTS; i++) {
        free(board->usarts[i].sent);
        free(board->usarts[i].line);
    }
    free(board->pins.planned);
    free(board->pins.changes);
    avr_terminate(board->avr);
    free(board->avr);
    free(board);
}

EXPORT void mrl_stop(board_t *board) { board->stop = true; }
EXPORT uint64_t mrl_cycle(board_t *board) { return board->avr->cycle; }
EXPORT uint32_t mrl_pc(board_t *board) { return board->avr->pc; }
EXPORT int mrl_interrupts_on(board_t *board) { return board->avr->sreg[S_I]; }
EXPORT uint32_t mrl_crash_pc(board_t *board) { return board->crash_pc; }
EXPORT uint64_t mrl_resets(board_t *board) { return board->resets; }
EXPORT uint8_t *mrl_data(board_t *board) { return board->avr->data; }
EXPORT const char *mrl_message(void) { return last_message; }
EXPORT uint32_t mrl_ram_end(board_t *board) { return board->avr->ramend; }
EXPORT uint64_t mrl_slept(board_t *board) { return board->slept; }

/* Earliest cycle at which the chip can do anything by itself: now while it is awake, else the next event of a timer
 * or peripheral; UINT64_MAX if there is none. */
EXPORT uint64_t mrl_next_event(board_t *board) {
    uint64_t now = board->avr->cycle, event = next_timer(board->avr);
    return board->asleep && event > now ? event : now;
}

