/* ADC: 13 ADC clocks a conversion (25 the first time), floor(volts x 1024 / reference), free-running. */
#include "board.h"

enum { ADEN = 0x80, ADSC = 0x40, ADATE = 0x20, ADIF = 0x10, ADPS = 0x07 };
enum { ADLAR = 0x20, REFS_BIT = 6, ADTS = 0x07 };
enum { UPPER = 0x20, PINS = 7 }; /* bits of the channel: an upper pin, and which of eight */
enum { CONVERSION_CLOCKS = 13, FIRST_CLOCKS = 25, TOP = 1023 };

static const double BANDGAP_V = 1.1;

static uint64_t conversion_cycles(const board_t *board) {
    unsigned step = board->avr->data[ADCSRA] & ADPS;
    return (uint64_t)(board->adc.first ? FIRST_CLOCKS : CONVERSION_CLOCKS) << (step ? step : 1);
}

static double input_volts(board_t *board, int channel) {
    if (!(channel & ~(UPPER | PINS)))
        return board->hooks.adc((channel & UPPER ? PINS + 1 : 0) + (channel & PINS), board->avr->cycle);
    return channel == BANDGAP_CHANNEL ? BANDGAP_V : 0.0;
}

static uint16_t count_of(double volts, double reference) {
    double count = volts * (TOP + 1) / reference;
    if (!(count > 0))
        return 0;
    return count > TOP ? TOP : (uint16_t)count;
}

static void sample(board_t *board) {
    uint8_t admux = board->avr->data[ADMUX];
    int channel = (admux & MUX) | (board->avr->data[ADCSRB] & MUX5 ? UPPER : 0);
    board->adc.count = count_of(input_volts(board, channel), REFERENCES_V[admux >> REFS_BIT]);
}

static avr_cycle_count_t converted(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    uint8_t *data = avr->data;
    uint16_t shown = data[ADMUX] & ADLAR ? (uint16_t)(board->adc.count << 6) : board->adc.count;
    data[ADCL] = (uint8_t)shown;
    data[ADCH] = (uint8_t)(shown >> 8);
    data[ADCSRA] |= ADIF;
    board->adc.first = false;
    board_recheck(board);
    if ((data[ADCSRA] & ADATE) && !(data[ADCSRB] & ADTS)) {
        sample(board);
        return when + conversion_cycles(board);
    }
    data[ADCSRA] &= (uint8_t)~ADSC;
    return 0;
}

static void write_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    board_t *board = param;
    uint8_t before = avr->data[address];
    uint8_t running = before & ADSC;
    uint8_t flag = before & (value & ADIF ? 0 : ADIF);
    avr->data[address] = (value & (uint8_t)~(ADIF | ADSC)) | flag | running;
    if (!(value & ADEN)) {
        avr->data[address] &= (uint8_t)~ADSC;
        avr_cycle_timer_cancel(avr, converted, board);
        board->adc.first = true;
    } else if ((value & ADSC) && !running) {
        avr->data[address] |= ADSC;
        sample(board);
        avr_cycle_timer_register(avr, conversion_cycles(board), converted, board);
    }
}

void adc_reset(board_t *board) { board->adc.first = true; }

void adc_attach(board_t *board) {
    board_on_plain(board, ADCL, ADMUX);
    board_on(board, ADCSRA, write_control, NULL, board);
}
