; Toggles PB5 (D13) around instructions whose cycle counts the datasheet lists.
#define __SFR_OFFSET 0
#include <avr/io.h>

.macro mark
    sbi PINB, 5
.endm

.global main
main:
    ldi r16, 0x20
    out DDRB, r16
    clr r17
    clr r0
    ldi r30, lo8(room)
    ldi r31, hi8(room)
    mark
    mark            ; 0: nothing between: 2 cycles of the mark itself
    nop
    mark            ; 1: nop
    lds r18, room
    mark            ; 2: lds
    sts room, r18
    mark            ; 3: sts
    push r18
    mark            ; 4: push
    pop r18
    mark            ; 5: pop
    rcall leave
    mark            ; 6: rcall + ret
    call leave
    mark            ; 7: call + ret
    mul r16, r16
    mark            ; 8: mul
    adiw r24, 1
    mark            ; 9: adiw
    ld r18, Z+
    mark            ; 10: ld Z+
    st Z+, r18
    mark            ; 11: st Z+
    rjmp 1f
1:  mark            ; 12: rjmp
    lpm r18, Z
    mark            ; 13: lpm
    cpse r17, r17
    nop
    mark            ; 14: cpse that skips one word
    cpse r17, r17
    sts room, r18
    mark            ; 15: cpse that skips two words
    cp r17, r17
    brne 2f
    mark            ; 16: branch not taken (+ cp)
2:  cp r17, r17
    breq 3f
3:  mark            ; 17: branch taken (+ cp)
    ldd r18, Z+3
    mark            ; 18: ldd
    in r18, PINB
    mark            ; 19: in
    sbis PINB, 7
    nop
    mark            ; 20: sbis, skips or runs a nop: 2 cycles either way
    ldi r30, lo8(gs(4f))
    ldi r31, hi8(gs(4f))
    icall
    mark            ; 21: ldi, ldi, icall, ret
    jmp 5f
5:  mark            ; 22: jmp
    bset 6
    mark            ; 23: bset
stay:
    rjmp stay
leave:
4:  ret

.section .bss
room: .space 16
