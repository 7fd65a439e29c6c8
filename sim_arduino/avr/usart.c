/* USARTs: frames of 10 bits (8N1) from UBRR and U2X, UDR plus shift register in both directions, data overrun. */
#include "board.h"

#include <math.h>

enum { UCSRA, UCSRB, UCSRC, UBRRL = 4, UBRRH, UDR }; /* places behind the first one's address */
enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, FE = 0x10, DOR = 0x08, U2X = 0x02, MPCM = 0x01 };
enum { RXEN = 0x10, TXEN = 0x08 };
enum { LINE_BITS = 10, FIFO = 2 };

static uint8_t *reg(const usart_t *usart, int place) { return &usart->board->avr->data[usart->at->base + place]; }

static uint64_t bit_cycles(const usart_t *usart) {
    unsigned ubrr = (unsigned)((*reg(usart, UBRRH) & 0x0F) << 8 | *reg(usart, UBRRL));
    return (uint64_t)(ubrr + 1) * (*reg(usart, UCSRA) & U2X ? 8 : 16);
}

static unsigned frame_bits(const usart_t *usart) {
    unsigned format = *reg(usart, UCSRC);
    unsigned parity = format & 0x20 ? 1 : 0, stops = format & 0x08 ? 2 : 1;
    return 1 + 5 + ((format >> 1) & 3) + parity + stops;
}

static uint64_t cycles_until(avr_t *avr, double moment) {
    double cycles = ceil(moment - (double)avr->cycle);
    return cycles < 1 ? 1 : (uint64_t)cycles;
}

/* ---- transmitter ---- */

static avr_cycle_count_t frame_sent(avr_t *avr, avr_cycle_count_t when, void *param);

static void start_frame(usart_t *usart, uint8_t value, uint64_t start) {
    avr_t *avr = usart->board->avr;
    usart->shifting = true;
    usart->shift = value;
    usart->shift_start = start;
    usart->shift_end = start + bit_cycles(usart) * frame_bits(usart);
    avr_cycle_timer_register(avr, usart->shift_end - avr->cycle, frame_sent, usart);
}

static void log_sent(usart_t *usart) {
    if (board_room((void **)&usart->sent, &usart->sent_room, usart->sent_count, sizeof *usart->sent))
        usart->sent[usart->sent_count++] = (sent_byte_t){usart->shift_start, usart->shift_end, usart->shift};
}

static avr_cycle_count_t frame_sent(avr_t *avr, avr_cycle_count_t when, void *param) {
    usart_t *usart = param;
    log_sent(usart);
    usart->shifting = false;
    if (usart->full) {
        usart->full = false;
        *reg(usart, UCSRA) |= UDRE;
        start_frame(usart, usart->buffer, usart->shift_end);
    } else {
        *reg(usart, UCSRA) |= TXC;
    }
    board_recheck(usart->board);
    return 0;
}

static void write_udr(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    usart_t *usart = param;
    if (!(*reg(usart, UCSRB) & TXEN) || usart->full)
        return;
    if (!usart->shifting) {
        start_frame(usart, value, avr->cycle);
        return;
    }
    usart->full = true;
    usart->buffer = value;
    *reg(usart, UCSRA) &= (uint8_t)~UDRE;
}

/* The bytes sent since the last call; valid until the board runs again. */
EXPORT const sent_byte_t *mrl_uart_sent(usart_t *usart, size_t *count) {
    *count = usart->sent_count;
    usart->sent_count = 0;
    return usart->sent;
}

/* ---- the line from the host ---- */

static double end_of(const line_byte_t *byte) { return byte->start + LINE_BITS * byte->bit; }

static int bit_of(const line_byte_t *byte, int index) {
    if (index == 0)
        return 0;
    return index > 8 ? 1 : (byte->data >> (index - 1)) & 1;
}

static int level_at(const usart_t *usart, double moment) {
    for (size_t i = usart->line_first; i < usart->line_count; i++) {
        const line_byte_t *byte = &usart->line[i];
        if (moment >= byte->start && moment < end_of(byte))
            return bit_of(byte, (int)((moment - byte->start) / byte->bit));
    }
    return 1;
}

static bool next_falling_edge(const usart_t *usart, double from, double *edge) {
    for (size_t i = usart->line_first; i < usart->line_count; i++)
        for (int bit = 0; bit < LINE_BITS; bit++) {
            const line_byte_t *byte = &usart->line[i];
            double moment = byte->start + bit * byte->bit;
            bool falls = bit_of(byte, bit) == 0 && (bit == 0 || bit_of(byte, bit - 1) == 1);
            if (falls && moment >= from) {
                *edge = moment;
                return true;
            }
        }
    return false;
}

static void forget_line_before(usart_t *usart, double moment) {
    size_t first = usart->line_first;
    while (first < usart->line_count && end_of(&usart->line[first]) <= moment)
        first++;
    usart->line_first = first;
    board_forget(usart->line, &usart->line_first, &usart->line_count, sizeof *usart->line);
}

/* ---- receiver ---- */

static avr_cycle_count_t start_bit_seen(avr_t *avr, avr_cycle_count_t when, void *param);
static avr_cycle_count_t frame_received(avr_t *avr, avr_cycle_count_t when, void *param);

static void listen(usart_t *usart) {
    avr_t *avr = usart->board->avr;
    if (usart->receiving || !(*reg(usart, UCSRB) & RXEN))
        return;
    forget_line_before(usart, usart->look_from);
    if (!next_falling_edge(usart, usart->look_from, &usart->frame_start))
        return;
    usart->receiving = true;
    avr_cycle_timer_register(avr, cycles_until(avr, usart->frame_start), start_bit_seen, usart);
}

static avr_cycle_count_t start_bit_seen(avr_t *avr, avr_cycle_count_t when, void *param) {
    usart_t *usart = param;
    if (usart->fifo_count == FIFO + 1) {
        usart->fifo_count = FIFO;
        usart->overrun = true;
        usart->lost++;
        *reg(usart, UCSRA) |= DOR;
    }
    /* the receiver samples the middle of every bit and is done in the middle of the stop bit */
    double done = usart->frame_start + 9.5 * (double)bit_cycles(usart);
    avr_cycle_timer_register(avr, cycles_until(avr, done), frame_received, usart);
    return 0;
}

static received_t sample_frame(const usart_t *usart, double bit) {
    received_t frame = {0, 0};
    for (int i = 0; i < 8; i++)
        frame.data |= (uint8_t)(level_at(usart, usart->frame_start + (1.5 + i) * bit) << i);
    frame.frame_error = level_at(usart, usart->frame_start + 9.5 * bit) == 0;
    return frame;
}

static void show_fifo(usart_t *usart) {
    uint8_t *status = reg(usart, UCSRA);
    *status &= (uint8_t)~(RXC | FE | DOR);
    if (usart->fifo_count)
        *status |= RXC | (usart->fifo[0].frame_error ? FE : 0);
    if (usart->overrun)
        *status |= DOR;
}

static avr_cycle_count_t frame_received(avr_t *avr, avr_cycle_count_t when, void *param) {
    usart_t *usart = param;
    double bit = (double)bit_cycles(usart);
    usart->fifo[usart->fifo_count++] = sample_frame(usart, bit);
    show_fifo(usart);
    board_recheck(usart->board);
    usart->receiving = false;
    usart->look_from = usart->frame_start + 9.5 * bit;
    listen(usart);
    return 0;
}

static uint8_t read_udr(avr_t *avr, avr_io_addr_t address, void *param) {
    usart_t *usart = param;
    uint8_t value = usart->fifo_count ? usart->fifo[0].data : avr->data[address];
    if (usart->fifo_count) {
        usart->fifo[0] = usart->fifo[1];
        usart->fifo[1] = usart->fifo[2];
        usart->fifo_count--;
    }
    usart->overrun = false;
    show_fifo(usart);
    return value;
}

static void flush_receiver(usart_t *usart) {
    avr_cycle_timer_cancel(usart->board->avr, start_bit_seen, usart);
    avr_cycle_timer_cancel(usart->board->avr, frame_received, usart);
    usart->fifo_count = 0;
    usart->overrun = usart->receiving = false;
    show_fifo(usart);
}

/* ---- registers ---- */

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    uint8_t kept = avr->data[address] & (RXC | TXC | UDRE | FE | DOR);
    if (value & TXC)
        kept &= (uint8_t)~TXC;
    avr->data[address] = kept | (value & (U2X | MPCM));
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    usart_t *usart = param;
    bool was_on = avr->data[address] & RXEN;
    avr->data[address] = value;
    if (was_on && !(value & RXEN))
        flush_receiver(usart);
    if (!was_on && (value & RXEN)) {
        usart->look_from = (double)avr->cycle;
        listen(usart);
    }
}

/* Lets `length` bytes follow each other on the line from `start` on, or when the line is free. */
EXPORT void mrl_uart_send(usart_t *usart, const uint8_t *bytes, size_t length, uint64_t start) {
    if (!(*reg(usart, UCSRB) & RXEN))
        forget_line_before(usart, (double)usart->board->avr->cycle);
    if (usart->line_free < (double)start)
        usart->line_free = (double)start;
    for (size_t i = 0; i < length; i++) {
        if (!board_room((void **)&usart->line, &usart->line_room, usart->line_count, sizeof *usart->line))
            return;
        usart->line[usart->line_count++] = (line_byte_t){usart->line_free, usart->host_bit, bytes[i]};
        usart->line_free += LINE_BITS * usart->host_bit + usart->host_gap;
    }
    listen(usart);
}

EXPORT void mrl_uart_set_host(usart_t *usart, double bit, double gap) {
    usart->host_bit = bit;
    usart->host_gap = gap;
}

EXPORT double mrl_uart_line_free(usart_t *usart) { return usart->line_free; }
EXPORT uint64_t mrl_uart_lost(usart_t *usart) { return usart->lost; }
EXPORT uint64_t mrl_uart_bit(usart_t *usart) { return bit_cycles(usart); }

/* NULL if the chip does not have it. */
EXPORT usart_t *mrl_uart(board_t *board, int number) { return number < USARTS ? &board->usarts[number] : NULL; }

static void reset(usart_t *usart) {
    usart->shifting = usart->full = false;
    avr_cycle_timer_cancel(usart->board->avr, frame_sent, usart);
    *reg(usart, UCSRB) = 0;
    *reg(usart, UCSRC) = 0x06;
    *reg(usart, UCSRA) = UDRE;
    flush_receiver(usart);
}

void usarts_reset(board_t *board) {
    for (int i = 0; i < USARTS; i++)
        reset(&board->usarts[i]);
}

void usarts_attach(board_t *board) {
    for (int i = 0; i < USARTS; i++) {
        usart_t *usart = &board->usarts[i];
        int base = CHIP_USARTS[i].base;
        *usart = (usart_t){.board = board, .at = &CHIP_USARTS[i]};
        board_on_plain(board, base, base + UDR);
        board_on(board, base + UCSRA, write_status, NULL, usart);
        board_on(board, base + UCSRB, write_control, NULL, usart);
        board_on(board, base + UDR, write_udr, read_udr, usart);
    }
}
