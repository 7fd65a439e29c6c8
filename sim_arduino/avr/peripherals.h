/* The peripherals of one board: each is attached once, and reset with the chip. */
#ifndef MRL_PERIPHERALS_H
#define MRL_PERIPHERALS_H

#include "board.h"

void usart_attach(board_t *board);
void usart_reset(board_t *board);
void twi_attach(board_t *board);
void twi_reset(board_t *board);
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
void timer1_attach(board_t *board);
void timer1_reset(board_t *board);
void timer1_capture(board_t *board, bool rose, uint64_t cycle);
void timer8_attach(board_t *board);
void timer8_release(board_t *board);
void timer8_reset(board_t *board);
uint8_t timer8_levels(board_t *board, int port, uint64_t cycle);
uint64_t timer8_high_cycles(board_t *board, int port, int bit);
void timer8_pins_changed(board_t *board);
void pins_attach(board_t *board);
void pins_release(board_t *board);
void pins_reset(board_t *board);
void pins_set(board_t *board, int port, int bit, int level);
void pins_connect(board_t *board, chip_pin_t pin, bool timed);
void pins_compare(board_t *board, int port, uint64_t cycle);
bool pins_is_observed(const board_t *board, chip_pin_t pin);
void pin_interrupts_attach(board_t *board);
void pin_interrupts_changed(board_t *board, int port, uint8_t changed, uint8_t level);
bool pin_interrupts_observe(const board_t *board, chip_pin_t pin);
bool pin_interrupts_level_requests(const board_t *board, uint8_t vector);

#endif
