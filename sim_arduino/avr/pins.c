/* Digital pins, by the numbers of their ports (0 the chip's first) and their bits: levels, changes, plans, and the cycles for which each was driven high. */
#include "board.h"

/* Level of every pin of a port at a cycle: that of the output, or the external level of an input. */
static uint8_t levels(board_t *board, int port, uint64_t cycle) {
    const port_t *pins = &board->pins.ports[port];
    const uint8_t *data = board->avr->data;
    uint8_t outputs = data[pins->at->ddr], driven = data[pins->at->port], timed = pins->timed & outputs;
    if (timed)
        driven = (uint8_t)((driven & ~timed) | (timers_levels(board, port, cycle) & timed));
    return (uint8_t)((driven & outputs) | (pins->external & ~outputs));
}

static void note_change(board_t *board, int port, int bit, int level, uint64_t cycle) {
    pins_t *pins = &board->pins;
    pin_event_t change = {cycle, (uint8_t)port, (uint8_t)bit, (uint8_t)level};
    if (board_room((void **)&pins->changes, &pins->changes_room, pins->changes_count, sizeof change))
        pins->changes[pins->changes_count++] = change;
    board->hooks.pin(port, bit, level, cycle);
}

/* What a change of level does inside the chip. */
static void pass_on(board_t *board, int port, uint8_t changed, uint64_t cycle) {
    uint8_t now = board->pins.ports[port].level;
    pin_interrupts_changed(board, port, changed, now);
    if (port == SCL_PIN.port && (changed & ~now & (1 << SCL_PIN.bit)))
        twi_clocked_by_hand(board);
    timers_capture(board, port, changed, now, cycle);
}

/* Shows the levels in PIN and reports the watched pins; returns the pins that have changed. A pin that becomes an
 * output is reported even if its level stays. */
static uint8_t show_levels(board_t *board, int port, uint64_t cycle) {
    port_t *pins = &board->pins.ports[port];
    uint8_t now = levels(board, port, cycle), outputs = board->avr->data[pins->at->ddr];
    uint8_t changed = now ^ pins->level, begun = outputs & ~pins->outputs;
    pins->level = now;
    pins->outputs = outputs;
    board->avr->data[pins->at->pin] = now;
    for (int seen = (changed | begun) & pins->watched, bit = 0; seen; seen >>= 1, bit++)
        if (seen & 1)
            note_change(board, port, bit, now >> bit & 1, cycle);
    return changed;
}

/* Takes notice of all that may have changed the levels of a port. */
void pins_compare(board_t *board, int port, uint64_t cycle) {
    uint8_t changed = show_levels(board, port, cycle);
    if (changed)
        pass_on(board, port, changed, cycle);
}

/* ---- cycles driven high */

/* Counts the cycles of the pins that the port register has driven until now, and notes which it drives from now on. */
static void count_high(board_t *board, port_t *pins, uint8_t high) {
    uint64_t now = board->avr->cycle;
    for (int bit = 0, changed = pins->high ^ high; changed; changed >>= 1, bit++) {
        if (!(changed & 1))
            continue;
        if (pins->high >> bit & 1)
            pins->high_cycles[bit] += now - pins->high_since[bit];
        pins->high_since[bit] = now;
    }
    pins->high = high;
}

EXPORT uint64_t mrl_pin_high_cycles(board_t *board, int port, int bit) {
    const port_t *pins = &board->pins.ports[port];
    uint64_t high = pins->high_cycles[bit] + timers_high_cycles(board, port, bit);
    return pins->high >> bit & 1 ? high + board->avr->cycle - pins->high_since[bit] : high;
}

/* ---- registers */

static void register_changed(board_t *board, int port) {
    port_t *pins = &board->pins.ports[port];
    const uint8_t *data = board->avr->data;
    count_high(board, pins, (uint8_t)(data[pins->at->port] & data[pins->at->ddr] & ~pins->timed));
    pins_compare(board, port, board->avr->cycle);
}

static void write_port(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    port_t *pins = param;
    avr->data[address] = value;
    register_changed(pins->board, (int)(pins - pins->board->pins.ports));
}

static void write_direction(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    port_t *pins = param;
    avr->data[address] = value;
    if (pins->timed)
        timers_pins_changed(pins->board);
    register_changed(pins->board, (int)(pins - pins->board->pins.ports));
}

/* Ones written to PIN toggle the bits of PORT. */
static void write_pin(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    uint16_t port = ((port_t *)param)->at->port;
    write_port(avr, port, avr->data[port] ^ board_written_ones(avr, value), param);
}

static uint8_t read_pin(avr_t *avr, avr_io_addr_t address, void *param) {
    port_t *pins = param;
    if (!pins->timed)
        return avr->data[address];
    return levels(pins->board, (int)(pins - pins->board->pins.ports), avr->cycle);
}

/* A timer takes the output over from the port register, or gives it back. */
void pins_connect(board_t *board, chip_pin_t pin, bool timed) {
    port_t *pins = &board->pins.ports[pin.port];
    uint8_t mask = (uint8_t)(1 << pin.bit);
    pins->timed = (uint8_t)(timed ? pins->timed | mask : pins->timed & ~mask);
    register_changed(board, pin.port);
}

/* Somebody follows each change of the pin. */
bool pins_is_observed(const board_t *board, chip_pin_t pin) {
    return (board->pins.ports[pin.port].watched >> pin.bit & 1) || pin_interrupts_observe(board, pin);
}

/* ---- levels from outside */

static void set_at(board_t *board, int port, int bit, int level, uint64_t cycle) {
    uint8_t *external = &board->pins.ports[port].external, mask = (uint8_t)(1 << bit);
    *external = (uint8_t)(level ? *external | mask : *external & ~mask);
    pins_compare(board, port, cycle);
}

static bool is_planned(const pins_t *pins, int port, int bit) {
    for (size_t i = pins->planned_first; i < pins->planned_count; i++)
        if (pins->planned[i].port == port && pins->planned[i].bit == bit)
            return true;
    return false;
}

/* Sets a level from outside now; the plans for the pin stay as they are. */
EXPORT void mrl_pin_set(board_t *board, int port, int bit, int level) {
    port_t *pins = &board->pins.ports[port];
    set_at(board, port, bit, level, board->avr->cycle);
    if (!is_planned(&board->pins, port, bit))
        pins->planned = (uint8_t)((pins->planned & ~(1 << bit)) | (pins->external & (1 << bit)));
}

static avr_cycle_count_t planned_change(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    pins_t *pins = &board->pins;
    pins->delivering = true;
    while (pins->planned_first < pins->planned_count && pins->planned[pins->planned_first].cycle <= when) {
        pin_event_t event = pins->planned[pins->planned_first++];
        set_at(board, event.port, event.bit, event.level, event.cycle);
    }
    pins->delivering = false;
    board_forget(pins->planned, &pins->planned_first, &pins->planned_count, sizeof *pins->planned);
    return pins->planned_first < pins->planned_count ? pins->planned[pins->planned_first].cycle : 0;
}

static void arm_planned(board_t *board) {
    pins_t *pins = &board->pins;
    uint64_t now = board->avr->cycle;
    if (pins->delivering)
        return;
    avr_cycle_timer_cancel(board->avr, planned_change, board);
    if (pins->planned_first == pins->planned_count)
        return;
    uint64_t first = pins->planned[pins->planned_first].cycle;
    avr_cycle_timer_register(board->avr, first > now ? first - now : 1, planned_change, board);
}

/* Plans of one cycle keep their order. */
static void plan(board_t *board, int port, int bit, int level, uint64_t cycle) {
    pins_t *pins = &board->pins;
    uint8_t *last = &pins->ports[port].planned, mask = (uint8_t)(1 << bit);
    if (!board_room((void **)&pins->planned, &pins->planned_room, pins->planned_count, sizeof *pins->planned))
        return;
    size_t at = pins->planned_count++;
    for (; at > pins->planned_first && pins->planned[at - 1].cycle > cycle; at--)
        pins->planned[at] = pins->planned[at - 1];
    pins->planned[at] = (pin_event_t){cycle, (uint8_t)port, (uint8_t)bit, (uint8_t)level};
    *last = (uint8_t)(level ? *last | mask : *last & ~mask);
}

/* Plans a level from outside for a cycle. */
EXPORT void mrl_pin_plan(board_t *board, int port, int bit, int level, uint64_t cycle) {
    plan(board, port, bit, level, cycle);
    arm_planned(board);
}

/* The level from outside changes at each of these cycles, which rise, from the one that earlier plans leave it at. */
EXPORT void mrl_plan_edges(board_t *board, int port, int bit, const uint64_t *cycles, size_t count) {
    for (size_t i = 0; i < count; i++)
        plan(board, port, bit, !(board->pins.ports[port].planned >> bit & 1), cycles[i]);
    arm_planned(board);
}

EXPORT int mrl_pin_level(board_t *board, int port, int bit) {
    return levels(board, port, board->avr->cycle) >> bit & 1;
}

EXPORT void mrl_pin_watch(board_t *board, int port, int mask) {
    board->pins.ports[port].watched = (uint8_t)mask;
    timers_pins_changed(board);
}

/* The changes since the last call; valid until the board runs again. */
EXPORT const pin_event_t *mrl_pin_changes(board_t *board, size_t *count) {
    *count = board->pins.changes_count;
    board->pins.changes_count = 0;
    return board->pins.changes;
}

/* ---- life */

/* A reset begins: nothing is driven any more. */
void pins_release(board_t *board) {
    timers_release(board);
    for (int port = 0; port < PORTS; port++) {
        count_high(board, &board->pins.ports[port], 0);
        board->pins.ports[port].timed = 0;
    }
}

void pins_reset(board_t *board) {
    for (int port = 0; port < PORTS; port++)
        show_levels(board, port, board->avr->cycle);
    arm_planned(board);
}

/* Handlers that get their port. The run loop has nothing to look for after a write: no interrupt is enabled here. */
static void hear(port_t *pins, int address, avr_io_write_t write, avr_io_read_t read) {
    avr_t *avr = pins->board->avr;
    avr->io[address - 32].w.c = write;
    avr->io[address - 32].w.param = pins;
    avr->io[address - 32].r.c = read;
    avr->io[address - 32].r.param = pins;
}

void pins_attach(board_t *board) {
    for (int port = 0; port < PORTS; port++) {
        const chip_port_t *at = &CHIP_PORTS[port];
        port_t *pins = &board->pins.ports[port];
        *pins = (port_t){.board = board, .at = at, .level = 0xFF, .external = 0xFF, .planned = 0xFF};
        hear(pins, at->port, write_port, NULL);
        hear(pins, at->ddr, write_direction, NULL);
        hear(pins, at->pin, write_pin, read_pin);
    }
}
