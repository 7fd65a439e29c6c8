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
void adc_attach(board_t *board);
void eeprom_attach(board_t *board);
bool eeprom_is_ready(const board_t *board);
void adc_reset(board_t *board);
void timer1_attach(board_t *board);
void timer1_reset(board_t *board);
void timer1_capture(board_t *board, bool rose, uint64_t cycle);
void pins_attach(board_t *board);
void pins_reset(board_t *board);
void pins_set(board_t *board, int port, int bit, int level);

#endif
