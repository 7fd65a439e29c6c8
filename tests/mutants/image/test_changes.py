"""Which single changes of a hal file's text are tried."""

import pytest

from tests.mutants.cpp.build import FIRMWARE

from .build import IMAGES
from .changes import mutants_of


def changes_of(text):
    return {(mutant.function, mutant.before, mutant.after) for mutant, _ in mutants_of("hal_x.cpp", text)}


@pytest.mark.parametrize(
    "line, after",
    [
        ("  cli();", ";"),
        ("  if (full) put(byte);", "if (full) ;"),
        ("  if (full) put(byte);", "if (!(full)) put(byte);"),
        ("  TCCR0B = _BV(CS00);", "TCCR0B = 0;"),
        ("  PORTD |= IN;", "PORTD &= IN;"),
        ("  PORTD |= IN;", "PORTB |= IN;"),
        ("  left = 8;", "left = 9;"),
        ("  while (tick == LAST) look();", "while (tick != LAST) look();"),
        ('      "push r24   \\n\\t"   \\', '" \\n\\t"'),
        ('      "4: lds r24, %[enable]   \\n\\t"   \\', '"4: \\n\\t"'),
    ],
)
def test_one_place_is_changed(line, after):
    assert ("f", " ".join(line.rstrip("\\ ").split()), after) in changes_of(f"void f() {{\n{line}\n}}\n")


@pytest.mark.parametrize(
    "line",
    [
        "// 8 | 4",
        '#include "hal.h"',
        'static_assert(F_CPU == 16, "16 MHz");',
        "mrl::Ring<64> received;",
        "volatile uint16_t counts[2];",
    ],
)
def test_comments_and_declarations_are_left_alone(line):
    assert changes_of(f"{line}\n") == set()


def test_the_rest_of_the_text_stays():
    text = "void f() {\n  cli();\n  sei();\n}\n"
    assert {changed for _, changed in mutants_of("hal_x.cpp", text)} == {
        "void f() {\n  ;\n  sei();\n}\n",
        "void f() {\n  cli();\n  ;\n}\n",
    }


def test_each_mutant_has_a_key_of_its_own():
    keys = [mutant.key for mutant, _ in mutants_of("hal_x.cpp", "void f() {\n  cli();\n  cli();\n}\n")]
    assert len(set(keys)) == len(keys) == 2


def test_every_hal_file_of_the_chip_has_an_image():
    assert set(IMAGES) == {path.name for path in FIRMWARE.glob("hal_*.cpp")}
