/* Digital pins of ports B, C, D (0, 1, 2): levels, changes, plans. */
#include "peripherals.h"

#include <simavr/avr_ioport.h>
#include <string.h>

static const chip_port_t *port_of(const board_t *board, int port) { return &board->chip->ports[port]; }

static bool is_pin(chip_pin_t pin, int port, int bit) { return pin.port == port && pin.bit == bit; }

/* Level of every pin of a port: that of the output, or the external level of an input. */
static uint8_t levels(const board_t *board, int port) {
    const uint8_t *data = board->avr->data;
    const chip_port_t *at = port_of(board, port);
    uint8_t direction = data[at->ddr];
    return (uint8_t)((data[at->port] & direction) | (board->pins.external[port] & ~direction));
}

static void note_change(board_t *board, int port, int bit, int level) {
    pins_t *pins = &board->pins;
    uint64_t cycle = board->avr->cycle;
    pin_event_t change = {cycle, (uint8_t)port, (uint8_t)bit, (uint8_t)level};
    if (board_room((void **)&pins->changes, &pins->changes_room, pins->changes_count, sizeof change))
        pins->changes[pins->changes_count++] = change;
    if (board->hooks.pin)
        board->hooks.pin(port, bit, level, cycle);
}

/* A pin that becomes an output counts as changed, even if its level stays. */
static void compare_levels(board_t *board, int port) {
    pins_t *pins = &board->pins;
    uint8_t now = levels(board, port), outputs = board->avr->data[port_of(board, port)->ddr];
    uint8_t changed = now ^ pins->level[port], begun = outputs & ~pins->outputs[port];
    pins->level[port] = now;
    pins->outputs[port] = outputs;
    chip_pin_t scl = board->chip->twi.scl;
    if (port == scl.port && (changed & ~now & (1 << scl.bit)))
        board->clocked_by_hand(board);
    for (int bit = 0; bit < 8; bit++)
        if ((changed | begun) & pins->watched[port] & (1 << bit))
            note_change(board, port, bit, (now >> bit) & 1);
}

static void port_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    port_register_t *written = param;
    written->write(avr, address, value, written->param);
    compare_levels(written->board, written->port);
}

/* ---- inputs ---- */

/* The core pulls its inputs to these levels whenever the port is written. */
static void show_outside(board_t *board, int port) {
    uint8_t value = board->pins.external[port];
    char name = port_of(board, port)->name;
    avr_ioport_external_t outside = {.name = name, .mask = 0xFF, .value = value};
    avr_ioctl(board->avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(name), &outside);
}

static void raise_input(board_t *board, int port, int bit) {
    avr_irq_t *pin = avr_io_getirq(board->avr, AVR_IOCTL_IOPORT_GETIRQ(port_of(board, port)->name), bit);
    avr_raise_irq(pin, (board->pins.external[port] >> bit) & 1);
}

static void set_at(board_t *board, int port, int bit, int level, uint64_t cycle) {
    avr_t *avr = board->avr;
    uint8_t mask = (uint8_t)(1 << bit), before = board->pins.external[port];
    board->pins.external[port] = (uint8_t)((board->pins.external[port] & ~mask) | (level ? mask : 0));
    show_outside(board, port);
    bool is_output = avr->data[port_of(board, port)->ddr] & mask;
    if (!is_output)
        raise_input(board, port, bit);
    if (is_pin(board->chip->timer1.capture, port, bit) && before != board->pins.external[port])
        timer1_capture(board, level, cycle);
    compare_levels(board, port);
    board_recheck(board);
}

void pins_set(board_t *board, int port, int bit, int level) { set_at(board, port, bit, level, board->avr->cycle); }

static avr_cycle_count_t planned_change(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    pins_t *pins = &board->pins;
    size_t done = 0;
    while (done < pins->planned_count && pins->planned[done].cycle <= when) {
        pin_event_t event = pins->planned[done++];
        set_at(board, event.port, event.bit, event.level, event.cycle);
    }
    pins->planned_count -= done;
    memmove(pins->planned, pins->planned + done, pins->planned_count * sizeof *pins->planned);
    (void)avr;
    return pins->planned_count ? pins->planned[0].cycle : 0;
}

static void arm_planned(board_t *board) {
    pins_t *pins = &board->pins;
    uint64_t now = board->avr->cycle;
    avr_cycle_timer_cancel(board->avr, planned_change, board);
    if (!pins->planned_count)
        return;
    uint64_t first = pins->planned[0].cycle;
    avr_cycle_timer_register(board->avr, first > now ? first - now : 1, planned_change, board);
}

/* Plans a level from outside for a cycle; plans of one cycle keep their order. */
EXPORT void mrl_pin_plan(board_t *board, int port, int bit, int level, uint64_t cycle) {
    pins_t *pins = &board->pins;
    if (!board_room((void **)&pins->planned, &pins->planned_room, pins->planned_count, sizeof *pins->planned))
        return;
    size_t at = pins->planned_count++;
    for (; at > 0 && pins->planned[at - 1].cycle > cycle; at--)
        pins->planned[at] = pins->planned[at - 1];
    pins->planned[at] = (pin_event_t){cycle, (uint8_t)port, (uint8_t)bit, (uint8_t)level};
    arm_planned(board);
}

EXPORT void mrl_pin_set(board_t *board, int port, int bit, int level) { pins_set(board, port, bit, level); }
EXPORT int mrl_pin_level(board_t *board, int port, int bit) { return (levels(board, port) >> bit) & 1; }
EXPORT void mrl_pin_watch(board_t *board, int port, int mask) { board->pins.watched[port] = (uint8_t)mask; }
EXPORT size_t mrl_pin_changes_count(board_t *board) { return board->pins.changes_count; }

EXPORT size_t mrl_pin_changes(board_t *board, pin_event_t *out, size_t limit) {
    pins_t *pins = &board->pins;
    size_t count = pins->changes_count < limit ? pins->changes_count : limit;
    if (count)
        memcpy(out, pins->changes, count * sizeof *out);
    pins->changes_count -= count;
    if (pins->changes_count)
        memmove(pins->changes, pins->changes + count, pins->changes_count * sizeof *out);
    return count;
}

/* ---- life ---- */

void pins_reset(board_t *board) {
    for (int port = 0; port < PORTS; port++) {
        show_outside(board, port);
        for (int bit = 0; bit < 8; bit++)
            raise_input(board, port, bit);
        board->avr->data[port_of(board, port)->pin] = board->pins.external[port];
        compare_levels(board, port);
    }
    arm_planned(board);
}

static void hear_register(board_t *board, int port, int offset) {
    const chip_port_t *at = port_of(board, port);
    const uint8_t addresses[] = {at->pin, at->ddr, at->port};
    int io = addresses[offset] - 32;
    port_register_t *heard = &board->pins.registers[port][offset];
    *heard = (port_register_t){board, port, board->avr->io[io].w.c, board->avr->io[io].w.param};
    board->avr->io[io].w.c = port_written;
    board->avr->io[io].w.param = heard;
}

void pins_attach(board_t *board) {
    memset(board->pins.external, 0xFF, sizeof board->pins.external);
    for (int port = 0; port < PORTS; port++)
        for (int offset = 0; offset < 3; offset++)
            hear_register(board, port, offset);
}
