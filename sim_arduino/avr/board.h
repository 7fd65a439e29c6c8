/* One simulated Arduino: libsimavr's core with peripherals of our own where 1.6 is not true to the chip (USARTs, TWI, ADC, EEPROM, watchdog, timers, pins and their interrupts, sleep, interrupts).
 *
 * libsimavr is GPL. This code is compiled on the user's machine; no binary linked with it is shipped.
 * It is compiled for one chip (see chip.h).
 * All times are CPU cycles since power-up; numbers are from the chips' data sheets unless named otherwise.
 */
#ifndef MRL_BOARD_H
#define MRL_BOARD_H

#include "chip.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <simavr/sim_avr.h>

#define EXPORT __attribute__((visibility("default")))

enum { I2C_BUFFER = 64 };

enum run_status { RUN_DONE = 0, RUN_CRASHED = 1, RUN_STOPPED = 2 };

typedef struct board board_t;

/* What the board asks the outside; `cycle` is the moment it happened. */
typedef struct {
    int (*present)(uint8_t address, uint64_t cycle); /* of an I2C device */
    void (*write)(uint8_t address, const uint8_t *data, int length, uint64_t cycle);
    int (*read)(uint8_t address, uint8_t *out, int limit, uint64_t cycle);
    double (*adc)(int channel, uint64_t cycle); /* -> V */
    void (*pin)(int port, int bit, int level, uint64_t cycle);
} hooks_t;

typedef struct {
    double start; /* falling edge of the start bit */
    double bit;   /* length of one bit */
    uint8_t data;
} line_byte_t;

typedef struct {
    uint64_t start, end;
    uint8_t data;
} sent_byte_t;

typedef struct {
    uint8_t data, frame_error;
} received_t;

typedef struct {
    board_t *board;
    const chip_usart_t *at;
    /* transmitter */
    bool shifting, full;
    uint8_t shift, buffer;
    uint64_t shift_start, shift_end;
    sent_byte_t *sent;
    size_t sent_count, sent_room;
    /* receiver */
    received_t fifo[3]; /* two that the program can read, and one that waits in the shift register */
    int fifo_count;
    bool overrun, receiving;
    double look_from, frame_start;
    line_byte_t *line;
    size_t line_first, line_count, line_room; /* used: line[line_first] to line[line_count - 1] */
    double line_free, host_bit, host_gap;
    uint64_t lost;
} usart_t;

enum twi_phase { TWI_IDLE, TWI_START, TWI_STOP, TWI_ADDRESS, TWI_SEND, TWI_RECEIVE };
enum bus_hang { HANG_NONE = 0, HANG_SDA_LOW = 1, HANG_SCL_LOW = 2 };

typedef struct {
    enum twi_phase phase;
    bool owned, address_next, reading, start_after_stop;
    uint8_t address, buffer[I2C_BUFFER];
    int length, position;
    /* faults */
    enum bus_hang hang;
    int stretch;        /* cycles a slave adds to every byte */
    int nack_after;     /* data bytes acknowledged before the first NACK; -1 = all */
    int release_clocks; /* clock pulses by hand after which a stuck slave lets SDA go; 0 = never */
} twi_t;

typedef struct {
    avr_io_t io; /* first: the `wdr` instruction reaches us as an ioctl of this module */
    board_t *board;
    uint64_t change_until; /* timed sequence: WDE and WDP may change up to this cycle */
} watchdog_t;

typedef struct {
    bool first;
    uint16_t count;
} adc_t;

/* The output of a compare unit; `level` is kept while the pin is not driven, too. */
typedef struct {
    bool level, driving;
    uint64_t high_cycles, high_from; /* cycles for which it drove the pin high, counted up to `high_from` */
} timer_output_t;

typedef struct {
    board_t *board;
    const chip_timer_t *at;
    uint64_t origin, counted; /* the prescaler's start; number of its edges that are counted */
    int shift;                /* the prescaler divides by 1 << shift; negative while the timer stands */
    uint8_t mode;             /* WGM */
    uint8_t com[WIDE_UNITS];  /* what the compare unit does to its output; 0 while the mode disconnects it */
    uint16_t count, top, compare[WIDE_UNITS], buffer[WIDE_UNITS];
    uint8_t high;       /* of the 16-bit registers: the byte that they share */
    bool down, written; /* counts down; TCNT has been written since the last count */
    timer_output_t output[WIDE_UNITS];
} timer_state_t;

typedef struct {
    uint64_t cycle;
    uint8_t port, bit, level;
} pin_event_t;

/* One port. The masks have a bit a pin. */
typedef struct {
    board_t *board;
    const chip_port_t *at;
    uint8_t level, outputs;              /* as the last comparison saw them */
    uint8_t external, planned, watched;  /* levels from outside now and after all plans; pins that are reported */
    uint8_t timed;                       /* pins whose level as an output comes from a timer */
    uint8_t high;                        /* pins that the port register drives high */
    uint64_t high_since[8], high_cycles[8];
} port_t;

typedef struct {
    port_t ports[PORTS];
    pin_event_t *planned; /* used: planned[planned_first] to planned[planned_count - 1], in order of time */
    size_t planned_first, planned_count, planned_room;
    bool delivering; /* planned levels are being set: a callback's new plan needs no event of its own */
    pin_event_t *changes;
    size_t changes_count, changes_room;
} pins_t;

typedef struct {
    board_t *board;
    avr_io_write_t write;
    void *param;
} wrapped_t;

struct board {
    avr_t *avr;
    hooks_t hooks;
    usart_t usarts[USARTS];
    twi_t twi;
    watchdog_t watchdog;
    adc_t adc;
    timer_state_t timers[TIMERS];
    pins_t pins;
    avr_int_vector_t *vector[VECTORS], changes[CHANGE_GROUPS];
    uint64_t flagless; /* vectors whose interrupts may have no flag, a bit each */
    wrapped_t wrapped[IO_ADDRESSES], eeprom_control;
    bool stop, reset_wanted, asleep;
    int reset_flags; /* MCUSR after a reset; -1 = what the chip sets */
    uint32_t crash_pc;
    uint16_t skips[FLASH_WORDS]; /* skip instructions that a WDR stands for, by their place; 0 elsewhere */
    uint8_t skipped;             /* words that such an instruction has just skipped */
    uint64_t run_until;     /* end of the running slice; 0 between slices */
    uint64_t resets, slept; /* number of program starts; cycles for which the CPU slept */
};

void board_on(board_t *board, int address, avr_io_write_t write, avr_io_read_t read, void *param);
void board_on_plain(board_t *board, int first, int last);
void board_recheck(board_t *board);
void board_refuse(board_t *board, const char *format, int value);
void board_write_and_recheck(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param);
uint8_t board_written_ones(const avr_t *avr, uint8_t value);
void board_clear_flags(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param);
void board_forget(void *items, size_t *first, size_t *count, size_t item_size);
bool board_room(void **items, size_t *room, size_t count, size_t item_size);

/* The peripherals: each is attached once, and reset with the chip. */
void usarts_attach(board_t *board);
void usarts_reset(board_t *board);
void twi_attach(board_t *board);
void twi_reset(board_t *board);
void twi_clocked_by_hand(board_t *board);
void watchdog_attach(board_t *board);
void watchdog_reset(board_t *board);
void watchdog_kick(board_t *board);
uint8_t watchdog_served(uint8_t control);
void skips_find(board_t *board, uint32_t address, uint32_t end);
bool skips_run(board_t *board);
void adc_attach(board_t *board);
void eeprom_attach(board_t *board);
bool eeprom_is_ready(const board_t *board);
void adc_reset(board_t *board);
void timers_capture(board_t *board, int port, uint8_t changed, uint8_t level, uint64_t cycle);
void timers_attach(board_t *board);
void timers_release(board_t *board);
void timers_reset(board_t *board);
uint8_t timers_levels(board_t *board, int port, uint64_t cycle);
uint64_t timers_high_cycles(board_t *board, int port, int bit);
void timers_pins_changed(board_t *board);
void pins_attach(board_t *board);
void pins_release(board_t *board);
void pins_reset(board_t *board);
EXPORT void mrl_pin_set(board_t *board, int port, int bit, int level);
void pins_connect(board_t *board, chip_pin_t pin, bool timed);
void pins_compare(board_t *board, int port, uint64_t cycle);
bool pins_is_observed(const board_t *board, chip_pin_t pin);
void pin_interrupts_attach(board_t *board);
void pin_interrupts_changed(board_t *board, int port, uint8_t changed, uint8_t level);
bool pin_interrupts_observe(const board_t *board, chip_pin_t pin);
bool pin_interrupts_level_requests(const board_t *board, uint8_t vector);

#endif
