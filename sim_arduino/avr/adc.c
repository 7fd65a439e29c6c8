/* ADC: 13 ADC clocks a conversion (25 the first time), floor(volts x 1024 / reference), free-running. */
#include "peripherals.h"

enum { ADEN = 0x80, ADSC = 0x40, ADATE = 0x20, ADIF = 0x10, ADPS = 0x07 };
enum { ADLAR = 0x20, REFS = 0xC0, REFS_INTERNAL = 0xC0, MUX = 0x0F, ADTS = 0x07 };
enum { CONVERSION_CLOCKS = 13, FIRST_CLOCKS = 25, TOP = 1023 };

static const double SUPPLY_V = 5.0, BANDGAP_V = 1.1;

static uint64_t conversion_cycles(const board_t *board) {
    const chip_adc_t *at = &board->chip->adc;
    unsigned step = board->avr->data[at->adcsra] & ADPS;
    return (uint64_t)(board->adc.first ? FIRST_CLOCKS : CONVERSION_CLOCKS) << (step ? step : 1);
}

static double input_volts(board_t *board, int channel) {
    const chip_adc_t *at = &board->chip->adc;
    if (channel < at->pins)
        return board->hooks.adc ? board->hooks.adc(channel, board->avr->cycle) : 0.0;
    return channel == at->bandgap_channel ? BANDGAP_V : 0.0;
}

static uint16_t count_of(double volts, double reference) {
    double count = volts * (TOP + 1) / reference;
    if (!(count > 0))
        return 0;
    return count > TOP ? TOP : (uint16_t)count;
}

static void sample(board_t *board) {
    const chip_adc_t *at = &board->chip->adc;
    uint8_t admux = board->avr->data[at->admux];
    double reference = (admux & REFS) == REFS_INTERNAL ? BANDGAP_V : SUPPLY_V;
    board->adc.count = count_of(input_volts(board, admux & MUX), reference);
}

static avr_cycle_count_t converted(avr_t *avr, avr_cycle_count_t when, void *param) {
    board_t *board = param;
    const chip_adc_t *at = &board->chip->adc;
    uint8_t *data = avr->data;
    uint16_t shown = data[at->admux] & ADLAR ? (uint16_t)(board->adc.count << 6) : board->adc.count;
    data[at->adcl] = (uint8_t)shown;
    data[at->adch] = (uint8_t)(shown >> 8);
    data[at->adcsra] |= ADIF;
    board->adc.first = false;
    board_recheck(board);
    if ((data[at->adcsra] & ADATE) && !(data[at->adcsrb] & ADTS)) {
        sample(board);
        return when + conversion_cycles(board);
    }
    data[at->adcsra] &= (uint8_t)~ADSC;
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
    const chip_adc_t *at = &board->chip->adc;
    board_on_write(board, at->adcsra, write_control);
    board_on_write(board, at->adcsrb, NULL);
    board_on_write(board, at->admux, NULL);
    for (int address = at->adcl; address <= at->admux; address++)
        board_on_read(board, address, NULL);
}
