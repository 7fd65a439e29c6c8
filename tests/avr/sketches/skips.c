/* Skips an ADIW with a low nibble of F by each skip instruction, or not: sums and cycles. */
#include <avr/io.h>
#include <avr/pgmspace.h>

#define CASES 10

volatile uint8_t one = 1, sums[CASES], cycles[CASES];
volatile uint16_t from_table, from_call;
static const uint16_t table[] PROGMEM = {0xFC00, 0x960F};

#define TRY(number, skip)                                                                                              \
    do {                                                                                                               \
        uint16_t sum;                                                                                                  \
        TCNT1L = 0;                                                                                                    \
        asm volatile("clr %A0\n clr %B0\n" skip "\n adiw %0, 31\n adiw %0, 1" : "=&w"(sum) : "r"(bit));               \
        cycles[number] = TCNT1L;                                                                                       \
        sums[number] = sum;                                                                                            \
    } while (0)

int main(void) {
    uint8_t bit = one;
    uint16_t target;
    TCCR1B = _BV(CS10);
    GPIOR0 = 1;
    TRY(0, "sbrc %1, 1");
    TRY(1, "sbrs %1, 0");
    TRY(2, "sbic 0x1e, 1");
    TRY(3, "sbis 0x1e, 0");
    TRY(4, "cpse %1, %1");
    TRY(5, "sbrc %1, 0");
    TRY(6, "sbrs %1, 1");
    TRY(7, "sbic 0x1e, 0");
    TRY(8, "sbis 0x1e, 1");
    TRY(9, "cpse %1, __zero_reg__");
    from_table = pgm_read_word(&table[one - 1]);
    asm volatile("ldi r30, lo8(1f)\n ldi r31, hi8(1f)\n lpm %A0, Z+\n lpm %B0, Z\n rjmp 2f\n"
                 ".word 0x940E\n 1: .word 0x117D\n adiw r28, 28\n 2:" : "=&r"(target)::"r30", "r31");
    from_call = target;
    for (;;)
        ;
}
