/* TWI master: SCL = F_CPU / (16 + 2 TWBR 4^PS), 9 clocks a byte, one clock each for START and STOP.
 *
 * Slaves live outside: they are asked whether an address is there, get a write when it ends (STOP or repeated
 * START), and give the bytes of a read when its address is acknowledged.
 */
#include "board.h"

#include <string.h>

enum { TWINT = 0x80, TWEA = 0x40, TWSTA = 0x20, TWSTO = 0x10, TWWC = 0x08, TWEN = 0x04, TWIE = 0x01 };
enum { CLOCKS_PER_BYTE = 9, BUS_FREE = 0xF8 };
enum { ST_START = 0x08, ST_REPEATED = 0x10, ST_SLA_W_ACK = 0x18, ST_SLA_W_NACK = 0x20, ST_DATA_ACK = 0x28,
       ST_DATA_NACK = 0x30, ST_LOST = 0x38, ST_SLA_R_ACK = 0x40, ST_SLA_R_NACK = 0x48, ST_READ_ACK = 0x50,
       ST_READ_NACK = 0x58 };

static uint64_t scl_cycles(const board_t *board) {
    const uint8_t *data = board->avr->data;
    return 16 + 2 * (uint64_t)data[TWBR] * (1u << (2 * (data[TWSR] & 3)));
}

static void set_status(board_t *board, uint8_t status) {
    uint8_t *data = board->avr->data;
    data[TWSR] = (data[TWSR] & 3) | status;
}

static void ready(board_t *board, uint8_t status) {
    board->twi.phase = TWI_IDLE;
    set_status(board, status);
    board->avr->data[TWCR] |= TWINT;
    board_recheck(board);
}

static void deliver_write(board_t *board, uint64_t cycle) {
    twi_t *twi = &board->twi;
    if (twi->owned && !twi->reading && twi->length)
        board->hooks.write(twi->address, twi->buffer, twi->length, cycle);
    twi->length = 0;
}

static void release_bus(board_t *board) {
    twi_t *twi = &board->twi;
    twi->owned = twi->address_next = twi->reading = false;
    twi->length = 0;
}

static avr_cycle_count_t phase_done(avr_t *avr, avr_cycle_count_t when, void *param);

static void begin_phase(board_t *board, enum twi_phase phase, unsigned clocks) {
    uint64_t cycles = scl_cycles(board) * clocks;
    if (clocks == CLOCKS_PER_BYTE)
        cycles += (uint64_t)board->twi.stretch;
    board->twi.phase = phase;
    avr_cycle_timer_register(board->avr, cycles, phase_done, board);
}

/* ---- ends of phases ---- */

static void start_done(board_t *board, uint64_t cycle) {
    twi_t *twi = &board->twi;
    bool repeated = twi->owned;
    deliver_write(board, cycle);
    twi->owned = twi->address_next = true;
    twi->reading = false;
    ready(board, repeated ? ST_REPEATED : ST_START);
}

static void stop_done(board_t *board, uint64_t cycle) {
    twi_t *twi = &board->twi;
    deliver_write(board, cycle);
    release_bus(board);
    twi->phase = TWI_IDLE;
    set_status(board, BUS_FREE);
    board->avr->data[TWCR] &= (uint8_t)~TWSTO;
    if (twi->start_after_stop) {
        twi->start_after_stop = false;
        begin_phase(board, TWI_START, 1);
    }
}

static void fetch_read(board_t *board, uint64_t cycle) {
    twi_t *twi = &board->twi;
    memset(twi->buffer, 0xFF, sizeof twi->buffer);
    twi->position = 0;
    board->hooks.read(twi->address, twi->buffer, I2C_BUFFER, cycle);
}

static void address_done(board_t *board, uint64_t cycle) {
    twi_t *twi = &board->twi;
    uint8_t sent = board->avr->data[TWDR];
    twi->address = sent >> 1;
    twi->reading = sent & 1;
    twi->address_next = false;
    twi->length = 0;
    bool there = board->hooks.present(twi->address, cycle);
    if (there && twi->reading)
        fetch_read(board, cycle);
    if (twi->reading)
        ready(board, there ? ST_SLA_R_ACK : ST_SLA_R_NACK);
    else
        ready(board, there ? ST_SLA_W_ACK : ST_SLA_W_NACK);
}

static void send_done(board_t *board) {
    twi_t *twi = &board->twi;
    bool accepted = twi->nack_after < 0 || twi->length < twi->nack_after;
    if (accepted && twi->length < I2C_BUFFER)
        twi->buffer[twi->length++] = board->avr->data[TWDR];
    ready(board, accepted ? ST_DATA_ACK : ST_DATA_NACK);
}

static void receive_done(board_t *board) {
    twi_t *twi = &board->twi;
    uint8_t value = twi->position < I2C_BUFFER ? twi->buffer[twi->position++] : 0xFF;
    board->avr->data[TWDR] = twi->hang == HANG_SDA_LOW ? 0 : value;
    ready(board, board->avr->data[TWCR] & TWEA ? ST_READ_ACK : ST_READ_NACK);
}

/* A low SDA keeps START and STOP from happening and turns every transmitted 1 into a lost arbitration. */
static bool is_blocked(const twi_t *twi) {
    if (twi->hang == HANG_SCL_LOW)
        return true;
    return twi->hang == HANG_SDA_LOW && (twi->phase == TWI_START || twi->phase == TWI_STOP);
}

static bool loses_arbitration(const board_t *board) {
    const twi_t *twi = &board->twi;
    bool sending = twi->phase == TWI_ADDRESS || twi->phase == TWI_SEND;
    return twi->hang == HANG_SDA_LOW && sending && board->avr->data[TWDR] != 0;
}

static avr_cycle_count_t phase_done(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    if (is_blocked(&board->twi))
        return when + scl_cycles(board);
    if (loses_arbitration(board)) {
        release_bus(board);
        ready(board, ST_LOST);
        return 0;
    }
    switch (board->twi.phase) {
    case TWI_START: start_done(board, when); break;
    case TWI_STOP: stop_done(board, when); break;
    case TWI_ADDRESS: address_done(board, when); break;
    case TWI_SEND: send_done(board); break;
    case TWI_RECEIVE: receive_done(board); break;
    case TWI_IDLE: break;
    }
    return 0;
}

/* ---- registers ---- */

static void act(board_t *board, uint8_t control) {
    twi_t *twi = &board->twi;
    if (control & TWSTO) {
        twi->start_after_stop = control & TWSTA;
        if (twi->owned) {
            begin_phase(board, TWI_STOP, 1);
            return;
        }
        board->avr->data[TWCR] &= (uint8_t)~TWSTO;
    }
    if (control & TWSTA)
        begin_phase(board, TWI_START, 1);
    else if (twi->owned && twi->address_next)
        begin_phase(board, TWI_ADDRESS, CLOCKS_PER_BYTE);
    else if (twi->owned)
        begin_phase(board, twi->reading ? TWI_RECEIVE : TWI_SEND, CLOCKS_PER_BYTE);
}

static void switch_off(board_t *board, uint8_t control) {
    avr_cycle_timer_cancel(board->avr, phase_done, board);
    release_bus(board);
    board->twi.phase = TWI_IDLE;
    board->twi.start_after_stop = false;
    board->avr->data[TWCR] = control & (uint8_t)~(TWINT | TWSTO | TWWC);
    set_status(board, BUS_FREE);
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    twi_t *twi = &board->twi;
    uint8_t flag = avr->data[address] & TWINT;
    if (!(value & TWEN)) {
        switch_off(board, value);
        return;
    }
    avr->data[address] = (value & (uint8_t)~(TWINT | TWWC)) | (value & TWINT ? 0 : flag);
    if (twi->phase == TWI_STOP) {
        avr->data[address] |= TWSTO;
        twi->start_after_stop |= (value & TWSTA) != 0;
    } else if (twi->phase == TWI_IDLE && ((value & TWINT) || (!flag && (value & TWSTA)))) {
        act(board, value);
    }
}

static void write_data(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    bool busy = board->twi.phase != TWI_IDLE && board->twi.phase != TWI_STOP;
    if (busy)
        avr->data[TWCR] |= TWWC;
    else {
        avr->data[TWCR] &= (uint8_t)~TWWC;
        avr->data[address] = value;
    }
}

static void write_status(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    avr->data[address] = (avr->data[address] & 0xF8) | (value & 3);
}

/* ---- faults ---- */

EXPORT void mrl_twi_set_hang(board_t *board, int hang, int release_clocks) {
    board->twi.hang = (enum bus_hang)hang;
    board->twi.release_clocks = release_clocks;
    mrl_pin_set(board, SDA_PIN.port, SDA_PIN.bit, hang != HANG_SDA_LOW);
    mrl_pin_set(board, SCL_PIN.port, SCL_PIN.bit, hang != HANG_SCL_LOW);
}

EXPORT void mrl_twi_set_stretch(board_t *board, int cycles) { board->twi.stretch = cycles; }
EXPORT void mrl_twi_set_nack_after(board_t *board, int bytes) { board->twi.nack_after = bytes; }

/* A falling edge on SCL made through the port, with the TWI off. */
void twi_clocked_by_hand(board_t *board) {
    twi_t *twi = &board->twi;
    if (twi->hang != HANG_SDA_LOW || twi->release_clocks <= 0 || (board->avr->data[TWCR] & TWEN))
        return;
    if (--twi->release_clocks == 0)
        mrl_twi_set_hang(board, HANG_NONE, 0);
}

void twi_reset(board_t *board) {
    switch_off(board, 0);
    board->avr->data[TWBR] = 0;
    board->avr->data[TWSR] = BUS_FREE;
    board->avr->data[TWDR] = 0xFF;
}

void twi_attach(board_t *board) {
    board->twi.nack_after = -1;
    board_on_plain(board, TWBR, TWCR);
    board_on(board, TWCR, write_control, NULL, board);
    board_on(board, TWDR, write_data, NULL, board);
    board_on(board, TWSR, write_status, NULL, board);
}
