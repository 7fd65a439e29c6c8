/* USART0: frames of 10 bits (8N1) from UBRR and U2X, UDR plus shift register in both directions, data overrun. */
#include "board.h"

#include <math.h>

enum { RXC = 0x80, TXC = 0x40, UDRE = 0x20, FE = 0x10, DOR = 0x08, U2X = 0x02, MPCM = 0x01 };
enum { RXEN = 0x10, TXEN = 0x08 };
enum { LINE_BITS = 10, FIFO = 2 };

static uint64_t bit_cycles(const board_t *board) {
    const uint8_t *data = board->avr->data;
    unsigned ubrr = (unsigned)((data[UBRRH] & 0x0F) << 8 | data[UBRRL]);
    return (uint64_t)(ubrr + 1) * (data[UCSRA] & U2X ? 8 : 16);
}

static unsigned frame_bits(const board_t *board) {
    unsigned format = board->avr->data[UCSRC];
    unsigned parity = format & 0x20 ? 1 : 0, stops = format & 0x08 ? 2 : 1;
    return 1 + 5 + ((format >> 1) & 3) + parity + stops;
}

static uint64_t cycles_until(avr_t *avr, double moment) {
    double cycles = ceil(moment - (double)avr->cycle);
    return cycles < 1 ? 1 : (uint64_t)cycles;
}

/* ---- transmitter ---- */

static avr_cycle_count_t frame_sent(avr_t *avr, avr_cycle_count_t when, void *param);

static void start_frame(board_t *board, uint8_t value, uint64_t start) {
    usart_t *usart = &board->usart;
    usart->shifting = true;
    usart->shift = value;
    usart->shift_start = start;
    usart->shift_end = start + bit_cycles(board) * frame_bits(board);
    avr_cycle_timer_register(board->avr, usart->shift_end - board->avr->cycle, frame_sent, board);
}

static void log_sent(usart_t *usart) {
    if (board_room((void **)&usart->sent, &usart->sent_room, usart->sent_count, sizeof *usart->sent))
        usart->sent[usart->sent_count++] = (sent_byte_t){usart->shift_start, usart->shift_end, usart->shift};
}

static avr_cycle_count_t frame_sent(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    usart_t *usart = &board->usart;
    log_sent(usart);
    usart->shifting = false;
    if (usart->full) {
        usart->full = false;
        avr->data[UCSRA] |= UDRE;
        start_frame(board, usart->buffer, usart->shift_end);
    } else {
        avr->data[UCSRA] |= TXC;
    }
    board_recheck(board);
    return 0;
}

static void write_udr(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    if (!(avr->data[UCSRB] & TXEN) || board->usart.full)
        return;
    if (!board->usart.shifting) {
        start_frame(board, value, avr->cycle);
        return;
    }
    board->usart.full = true;
    board->usart.buffer = value;
    avr->data[UCSRA] &= (uint8_t)~UDRE;
}

/* The bytes sent since the last call; valid until the board runs again. */
EXPORT const sent_byte_t *mrl_uart_sent(board_t *board, size_t *count) {
    *count = board->usart.sent_count;
    board->usart.sent_count = 0;
    return board->usart.sent;
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

static void listen(board_t *board) {
    usart_t *usart = &board->usart;
    avr_t *avr = board->avr;
    if (usart->receiving || !(avr->data[UCSRB] & RXEN))
        return;
    forget_line_before(usart, usart->look_from);
    if (!next_falling_edge(usart, usart->look_from, &usart->frame_start))
        return;
    usart->receiving = true;
    avr_cycle_timer_register(avr, cycles_until(avr, usart->frame_start), start_bit_seen, board);
}

static avr_cycle_count_t start_bit_seen(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    usart_t *usart = &board->usart;
    if (usart->fifo_count == FIFO + 1) {
        usart->fifo_count = FIFO;
        usart->overrun = true;
        usart->lost++;
        avr->data[UCSRA] |= DOR;
    }
    /* the receiver samples the middle of every bit and is done in the middle of the stop bit */
    double done = usart->frame_start + 9.5 * (double)bit_cycles(board);
    avr_cycle_timer_register(avr, cycles_until(avr, done), frame_received, board);
    return 0;
}

static received_t sample_frame(const usart_t *usart, double bit) {
    received_t frame = {0, 0};
    for (int i = 0; i < 8; i++)
        frame.data |= (uint8_t)(level_at(usart, usart->frame_start + (1.5 + i) * bit) << i);
    frame.frame_error = level_at(usart, usart->frame_start + 9.5 * bit) == 0;
    return frame;
}

static void show_fifo(board_t *board) {
    uint8_t *status = &board->avr->data[UCSRA];
    *status &= (uint8_t)~(RXC | FE | DOR);
    if (board->usart.fifo_count)
        *status |= RXC | (board->usart.fifo[0].frame_error ? FE : 0);
    if (board->usart.overrun)
        *status |= DOR;
}

static avr_cycle_count_t frame_received(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    usart_t *usart = &board->usart;
    double bit = (double)bit_cycles(board);
    usart->fifo[usart->fifo_count++] = sample_frame(usart, bit);
    show_fifo(board);
    board_recheck(board);
    usart->receiving = false;
    usart->look_from = usart->frame_start + 9.5 * bit;
    listen(board);
    return 0;
}

static uint8_t read_udr(avr_t *avr, avr_io_addr_t address, void *param) {
    board_t *board = param;
    usart_t *usart = &board->usart;
    uint8_t value = usart->fifo_count ? usart->fifo[0].data : avr->data[address];
    if (usart->fifo_count) {
        usart->fifo[0] = usart->fifo[1];
        usart->fifo[1] = usart->fifo[2];
        usart->fifo_count--;
    }
    usart->overrun = false;
    show_fifo(board);
    return value;
}

static void flush_receiver(board_t *board) {
    usart_t *usart = &board->usart;
    avr_cycle_timer_cancel(board->avr, start_bit_seen, board);
    avr_cycle_timer_cancel(board->avr, frame_received, board);
    usart->fifo_count = 0;
    usart->overrun = usart->receiving = false;
    show_fifo(board);
}

/* ---- registers ---- */

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    uint8_t kept = avr->data[address] & (RXC | TXC | UDRE | FE | DOR);
    if (value & TXC)
        kept &= (uint8_t)~TXC;
    avr->data[address] = kept | (value & (U2X | MPCM));
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    bool was_on = avr->data[address] & RXEN;
    avr->data[address] = value;
    if (was_on && !(value & RXEN))
        flush_receiver(board);
    if (!was_on && (value & RXEN)) {
        board->usart.look_from = (double)avr->cycle;
        listen(board);
    }
}

/* Lets `length` bytes follow each other on the line from `start` on, or when the line is free. */
EXPORT void mrl_uart_send(board_t *board, const uint8_t *bytes, size_t length, uint64_t start) {
    usart_t *usart = &board->usart;
    if (!(board->avr->data[UCSRB] & RXEN))
        forget_line_before(usart, (double)board->avr->cycle);
    if (usart->line_free < (double)start)
        usart->line_free = (double)start;
    for (size_t i = 0; i < length; i++) {
        if (!board_room((void **)&usart->line, &usart->line_room, usart->line_count, sizeof *usart->line))
            return;
        usart->line[usart->line_count++] = (line_byte_t){usart->line_free, usart->host_bit, bytes[i]};
        usart->line_free += LINE_BITS * usart->host_bit + usart->host_gap;
    }
    listen(board);
}

EXPORT void mrl_uart_set_host(board_t *board, double bit, double gap) {
    board->usart.host_bit = bit;
    board->usart.host_gap = gap;
}

EXPORT double mrl_uart_line_free(board_t *board) { return board->usart.line_free; }
EXPORT uint64_t mrl_uart_lost(board_t *board) { return board->usart.lost; }
EXPORT uint64_t mrl_uart_bit(board_t *board) { return bit_cycles(board); }

void usart_reset(board_t *board) {
    uint8_t *data = board->avr->data;
    board->usart.shifting = board->usart.full = false;
    avr_cycle_timer_cancel(board->avr, frame_sent, board);
    data[UCSRB] = 0;
    data[UCSRC] = 0x06;
    data[UCSRA] = UDRE;
    flush_receiver(board);
}

void usart_attach(board_t *board) {
    board_on_plain(board, UCSRA, UDR);
    board_on(board, UCSRA, write_status, NULL, board);
    board_on(board, UCSRB, write_control, NULL, board);
    board_on(board, UDR, write_udr, read_udr, board);
}
