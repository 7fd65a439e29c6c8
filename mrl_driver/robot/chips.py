"""What the pins of the boards' chips can do.  Pins have the Arduino's numbers.

Sources: the data sheets of ATmega48A/PA/88A/PA/168A/PA/328/P (DS40002061B, pin configurations) and of
ATmega640/1280/1281/2560/2561 (DS40002211A, the same), and Arduino's pinouts of the Uno Rev3 and the Mega 2560 Rev3 for
the numbers.
"""

import re
from typing import Dict, NamedTuple, Optional, Tuple

NONE = -1


class Pin(NamedTuple):
    """A pin: its port's letter and its bit there, and what it can do; `NONE` if it cannot."""

    port: str
    bit: int
    timer: int = NONE
    """Number of the timer that makes PWM on it."""
    unit: int = NONE
    """Compare unit of the timer: 0 A, 1 B, 2 C."""
    change: int = NONE
    """Number of the pin-change interrupt: eight share one vector."""
    external: int = NONE
    """Number of the external interrupt."""
    channel: int = NONE
    """Channel of the converter."""

    @property
    def interrupts(self) -> bool:
        """Whether an interrupt follows each change of its level."""
        return self.change != NONE or self.external != NONE


class Chip(NamedTuple):
    """A chip on its board."""

    name: str
    board: str
    pins: Tuple[Pin, ...]
    led: int
    """The bootloader blinks it."""
    serial: Tuple[int, int]
    bus: Tuple[int, int]
    """SDA and SCL."""
    analog: int
    """Number of A0."""
    flash_bytes: int
    eeprom_bytes: int

    @property
    def its_pins(self) -> str:
        """What is expected for a pin.  A Nano also has the analog inputs A6 and A7, which are not used."""
        last = self.label(len(self.pins) - 1)
        return f"a pin of the {self.board}: D0 to D{self.analog - 1} or A0 to {last}"

    def number(self, text: str) -> Optional[int]:
        """Return the number of a pin written as `5`, `D5` or `A4`; None if the chip does not have it."""
        found = re.fullmatch("([ADad]?)([0-9]{1,2})", text)
        if not found:
            return None
        number = int(found[2]) + (self.analog if found[1] in ("A", "a") else 0)
        return number if number < len(self.pins) else None

    def label(self, number: int) -> str:
        """Return how a pin is written on the board, such as `D5` or `A4`; it may be one that the chip does not have."""
        return f"A{number - self.analog}" if self.analog <= number < len(self.pins) else f"D{number}"


def _pins(rows: str) -> Tuple[Pin, ...]:
    """Return the pins in order of their numbers, each given as its place and its functions as in the data sheet."""
    found = []
    for row in rows.split():
        place, *functions = row.split("/")
        numbers = dict(re.findall(r"([A-Z]+)(\d+[ABC]?)", " ".join(functions)))
        compare = numbers.get("OC")
        found.append(
            Pin(
                place[1],
                int(place[2]),
                int(compare[0]) if compare else NONE,
                "ABC".index(compare[1]) if compare else NONE,
                *(int(numbers.get(name, NONE)) for name in ("PCINT", "INT", "ADC")),
            )
        )
    return tuple(found)


ATMEGA328P = Chip(
    "atmega328p",
    "Uno or Nano",
    _pins(
        """
        PD0/PCINT16 PD1/PCINT17 PD2/PCINT18/INT0 PD3/OC2B/PCINT19/INT1 PD4/PCINT20 PD5/OC0B/PCINT21
        PD6/OC0A/PCINT22 PD7/PCINT23 PB0/PCINT0 PB1/OC1A/PCINT1 PB2/OC1B/PCINT2 PB3/OC2A/PCINT3 PB4/PCINT4
        PB5/PCINT5 PC0/PCINT8/ADC0 PC1/PCINT9/ADC1 PC2/PCINT10/ADC2 PC3/PCINT11/ADC3 PC4/PCINT12/ADC4
        PC5/PCINT13/ADC5
        """
    ),
    led=13,
    serial=(0, 1),
    bus=(18, 19),
    analog=14,
    flash_bytes=32 * 1024,
    eeprom_bytes=1024,
)
ATMEGA2560 = Chip(
    "atmega2560",
    "Mega 2560",
    _pins(
        """
        PE0/PCINT8 PE1 PE4/OC3B/INT4 PE5/OC3C/INT5 PG5/OC0B PE3/OC3A PH3/OC4A PH4/OC4B PH5/OC4C PH6/OC2B
        PB4/OC2A/PCINT4 PB5/OC1A/PCINT5 PB6/OC1B/PCINT6 PB7/OC0A/PCINT7 PJ1/PCINT10 PJ0/PCINT9 PH1 PH0
        PD3/INT3 PD2/INT2 PD1/INT1 PD0/INT0
        PA0 PA1 PA2 PA3 PA4 PA5 PA6 PA7 PC7 PC6 PC5 PC4 PC3 PC2 PC1 PC0 PD7 PG2 PG1 PG0 PL7 PL6
        PL5/OC5C PL4/OC5B PL3/OC5A PL2 PL1 PL0 PB3/PCINT3 PB2/PCINT2 PB1/PCINT1 PB0/PCINT0
        PF0/ADC0 PF1/ADC1 PF2/ADC2 PF3/ADC3 PF4/ADC4 PF5/ADC5 PF6/ADC6 PF7/ADC7
        PK0/PCINT16/ADC8 PK1/PCINT17/ADC9 PK2/PCINT18/ADC10 PK3/PCINT19/ADC11 PK4/PCINT20/ADC12
        PK5/PCINT21/ADC13 PK6/PCINT22/ADC14 PK7/PCINT23/ADC15
        """
    ),
    led=13,
    serial=(0, 1),
    bus=(20, 21),
    analog=54,
    flash_bytes=256 * 1024,
    eeprom_bytes=4 * 1024,
)
CHIPS: Dict[str, Chip] = {chip.name: chip for chip in (ATMEGA328P, ATMEGA2560)}
