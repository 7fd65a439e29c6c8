/* The skip instructions that libsimavr gets wrong: it takes ADIW or SBIW with a low nibble of C to F for two words.
 * Such a skip is a WDR in the simulated flash, because WDR is the instruction that reaches this harness. */
#include "board.h"

enum { WDR = 0x95A8, JMP = 0x940C, RJMP = 0xC000 };

static uint16_t word_at(const avr_t *avr, uint32_t address) {
    return (uint16_t)(avr->flash[address] | avr->flash[address + 1] << 8);
}

static bool is_cpse(uint16_t word) { return (word & 0xFC00) == 0x1000; }
static bool is_sbic_or_sbis(uint16_t word) { return (word & 0xFD00) == 0x9900; }
static bool is_sbrc_or_sbrs(uint16_t word) { return (word & 0xFC08) == 0xFC00; }
static bool is_two_words(uint16_t word) { return (word & 0xFC0F) == 0x9000 || (word & 0xFE0C) == 0x940C; }
static bool is_mistaken(uint16_t word) { return (word & 0xFE0C) == 0x960C; }

static uint8_t read_io(avr_t *avr, avr_io_addr_t address) {
    const avr_io_addr_t io = AVR_DATA_TO_IO(address);
    return avr->io[io].r.c ? avr->io[io].r.c(avr, address, avr->io[io].r.param) : avr->data[address];
}

static bool is_taken(avr_t *avr, uint16_t skip) {
    const uint8_t first = skip >> 4 & 31;
    if (is_cpse(skip))
        return avr->data[first] == avr->data[(skip & 15) | (skip >> 5 & 16)];
    const uint8_t value = is_sbic_or_sbis(skip) ? read_io(avr, 32 + (skip >> 3 & 31)) : avr->data[first];
    return (value >> (skip & 7) & 1) == (skip >> 9 & 1);
}

/* Where the program begins: avr-gcc puts its tables between the vectors and the target of the first one. With more than
 * 128 KiB of flash, bit 0 of a JMP is part of its target. */
static uint32_t code_begin(const avr_t *avr) {
    const uint16_t first = word_at(avr, 0);
    if ((first & ~1) == JMP)
        return 2u * ((first & 1u) << 16 | word_at(avr, 2));
    return (first & 0xF000) == RJMP ? 2u * (first & 0x0FFF) + 2 : 0;
}

/* Finds the places in flash of which bytes from `address` to `end` are new. It goes from instruction to instruction: the
 * second word of a CALL may look like a skip. */
void skips_find(board_t *board, uint32_t address, uint32_t end) {
    avr_t *avr = board->avr;
    for (uint32_t at = address; at < end; at += 2)
        board->skips[at / 2] = 0;
    const uint32_t begin = code_begin(avr), before = address < 2 ? 0 : address - 2;
    for (uint32_t at = begin; at < end && at + 3 <= avr->flashend; at += is_two_words(word_at(avr, at)) ? 4 : 2) {
        const uint16_t word = word_at(avr, at);
        if (at < before || !(is_cpse(word) || is_sbic_or_sbis(word) || is_sbrc_or_sbrs(word)) || !is_mistaken(word_at(avr, at + 2)))
            continue;
        board->skips[at / 2] = word;
        avr->flash[at] = WDR & 0xFF;
        avr->flash[at + 1] = WDR >> 8;
    }
}

/* Whether the WDR at the program counter is a skip; then the core returns behind it, and the run loop skips. */
bool skips_run(board_t *board) {
    avr_t *avr = board->avr;
    const uint16_t skip = board->skips[avr->pc / 2];
    if (!skip)
        return false;
    if (is_taken(avr, skip))
        board->skipped = is_two_words(word_at(avr, avr->pc + 2)) ? 2 : 1;
    avr->run_cycle_count = 0;
    return true;
}
