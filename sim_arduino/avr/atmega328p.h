/* The ATmega328P, the chip of the Arduino Uno and Nano. */
#define CHIP_NAME "atmega328p" /* libsimavr's */

enum { PORTS = 3, TIMERS = 3, WIDE_UNITS = 2, USARTS = 1, EXTERNALS = 2, VECTORS = 32 };
enum { IO_ADDRESSES = 0x100, FLASH_WORDS = 0x4000 };
enum { INTERRUPT_CYCLES = 4 }; /* of an interrupt's entry, and the same again from sleep */
enum { CHANGE_VECTOR = 3, WATCHDOG_VECTOR = 6, EEPROM_VECTOR = 22, TWI_VECTOR = 24 };

enum { PORT_B, PORT_C, PORT_D };
static const chip_port_t CHIP_PORTS[PORTS] = {
    [PORT_B] = {PORT_AT(0x23), 0xFF, 0, 0, 0x6B},
    [PORT_C] = {PORT_AT(0x26), 0xFF, 1, 0, 0x6C},
    [PORT_D] = {PORT_AT(0x29), 0xFF, 2, 0, 0x6D},
};
static const chip_pin_t SDA_PIN = {PORT_C, 4}, SCL_PIN = {PORT_C, 5};
static const chip_pin_t CHIP_EXTERNALS[EXTERNALS] = {{PORT_D, 2}, {PORT_D, 3}};
static const chip_usart_t CHIP_USARTS[USARTS] = {{0xC0, 18}};

static const chip_timer_t CHIP_TIMERS[TIMERS] = {
    {0xFF, 0x35, 0x6E, NARROW_AT(0x44), DIVIDERS, {{PORT_D, 6}, {PORT_D, 5}, NO_PIN}, NO_PIN},
    {0xFFFF, 0x36, 0x6F, WIDE_AT(0x80), DIVIDERS, {{PORT_B, 1}, {PORT_B, 2}, NO_PIN}, {PORT_B, 0}},
    {0xFF, 0x37, 0x70, NARROW_AT(0xB0), DIVIDERS_OF_TIMER2, {{PORT_B, 3}, {PORT_D, 3}, NO_PIN}, NO_PIN},
};

/* ADC: bits of ADMUX and ADCSRB that choose the channel, the internal reference's channel, and by REFS the reference. */
enum { MUX = 0x0F, MUX5 = 0, BANDGAP_CHANNEL = 14 };
static const double REFERENCES_V[4] = {5.0, 5.0, 5.0, 1.1};
