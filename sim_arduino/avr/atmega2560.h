/* The ATmega2560, the chip of the Arduino Mega 2560. */
#define CHIP_NAME "atmega2560" /* libsimavr's */

enum { PORTS = 11, TIMERS = 6, WIDE_UNITS = 3, USARTS = 4, EXTERNALS = 8, VECTORS = 57 };
enum { IO_ADDRESSES = 0x140, FLASH_WORDS = 0x20000 };
enum { INTERRUPT_CYCLES = 5 }; /* of an interrupt's entry, and the same again from sleep */
enum { CHANGE_VECTOR = 9, WATCHDOG_VECTOR = 12, EEPROM_VECTOR = 30, TWI_VECTOR = 39 };

enum { PORT_A, PORT_B, PORT_C, PORT_D, PORT_E, PORT_F, PORT_G, PORT_H, PORT_J, PORT_K, PORT_L };
static const chip_port_t CHIP_PORTS[PORTS] = {
    [PORT_A] = {PORT_AT(0x20), 0, 0, 0, 0},
    [PORT_B] = {PORT_AT(0x23), 0xFF, 0, 0, 0x6B},
    [PORT_C] = {PORT_AT(0x26), 0, 0, 0, 0},
    [PORT_D] = {PORT_AT(0x29), 0, 0, 0, 0},
    [PORT_E] = {PORT_AT(0x2C), 0x01, 1, 0, 0x6C}, /* PCINT8 */
    [PORT_F] = {PORT_AT(0x2F), 0, 0, 0, 0},
    [PORT_G] = {PORT_AT(0x32), 0, 0, 0, 0},
    [PORT_H] = {PORT_AT(0x100), 0, 0, 0, 0},
    [PORT_J] = {PORT_AT(0x103), 0x7F, 1, 1, 0x6C}, /* PCINT9 to PCINT15 */
    [PORT_K] = {PORT_AT(0x106), 0xFF, 2, 0, 0x6D},
    [PORT_L] = {PORT_AT(0x109), 0, 0, 0, 0},
};
static const chip_pin_t SDA_PIN = {PORT_D, 1}, SCL_PIN = {PORT_D, 0};
static const chip_pin_t CHIP_EXTERNALS[EXTERNALS] = {{PORT_D, 0}, {PORT_D, 1}, {PORT_D, 2}, {PORT_D, 3},
                                                     {PORT_E, 4}, {PORT_E, 5}, {PORT_E, 6}, {PORT_E, 7}};
static const chip_usart_t CHIP_USARTS[USARTS] = {{0xC0, 25}, {0xC8, 36}, {0xD0, 51}, {0x130, 54}};

/* OC1C shares its pin with OC0A, and is not simulated. */
static const chip_timer_t CHIP_TIMERS[TIMERS] = {
    {0xFF, 0x35, 0x6E, NARROW_AT(0x44), DIVIDERS, {{PORT_B, 7}, {PORT_G, 5}, NO_PIN}, NO_PIN},
    {0xFFFF, 0x36, 0x6F, WIDE_AT(0x80), DIVIDERS, {{PORT_B, 5}, {PORT_B, 6}, NO_PIN}, {PORT_D, 4}},
    {0xFF, 0x37, 0x70, NARROW_AT(0xB0), DIVIDERS_OF_TIMER2, {{PORT_B, 4}, {PORT_H, 6}, NO_PIN}, NO_PIN},
    {0xFFFF, 0x38, 0x71, WIDE_AT(0x90), DIVIDERS, {{PORT_E, 3}, {PORT_E, 4}, {PORT_E, 5}}, {PORT_E, 7}},
    {0xFFFF, 0x39, 0x72, WIDE_AT(0xA0), DIVIDERS, {{PORT_H, 3}, {PORT_H, 4}, {PORT_H, 5}}, {PORT_L, 0}},
    {0xFFFF, 0x3A, 0x73, WIDE_AT(0x120), DIVIDERS, {{PORT_L, 3}, {PORT_L, 4}, {PORT_L, 5}}, {PORT_L, 1}},
};

/* ADC: bits of ADMUX and ADCSRB that choose the channel, the internal reference's channel, and by REFS the reference. */
enum { MUX = 0x1F, MUX5 = 0x08, BANDGAP_CHANNEL = 30 };
static const double REFERENCES_V[4] = {5.0, 5.0, 1.1, 2.56};
