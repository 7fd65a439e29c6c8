"""The wiring diagram of a robot's file, as SVG: the pins of the Arduino at the left, the parts at the right."""

from typing import Dict, Iterator, List, NamedTuple, Sequence, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BRIDGES, NOT_CONNECTED, WHEELS
from mrl_driver.robot import models, wiring
from mrl_driver.robot.chips import CHIPS

CARRIERS = {"tb6612": (("PWM{}", "{}IN1", "{}IN2"), ("VCC", "STBY"), ("{}O1", "{}O2"), "VM")}
"""Boards with a bridge for two motors: their inputs, what needs 5 V, outputs to a motor, and the battery's input."""
CHANNELS, POWER, GROUND = "AB", "5V", "GND"
WIDTH, ROW, PIN_X, PART_X, PART_WIDTH, LOAD_WIDTH, OUT = 400, 20, 100, 164, 228, 114, 14
STYLE = """\
text{font:13px sans-serif;fill:#1b1f24}.b{font-weight:bold}.e{text-anchor:end}.card{fill:#fff}
.box{fill:#eef2f7;stroke:#57606a}path{fill:none;stroke-width:2}
.signal{stroke:#0969da}circle{fill:#0969da}.power{stroke:#cf222e}.ground{stroke:#57606a}
@media(prefers-color-scheme:dark){text{fill:#e6edf3}.card{fill:#0d1117}.box{fill:#21262d;stroke:#8b949e}
.signal{stroke:#58a6ff}circle{fill:#58a6ff}.power{stroke:#ff7b72}.ground{stroke:#8b949e}}"""
NOTES = ("Dot: 10 kΩ from this input to GND.", "In the wire of battery +: a switch and a fuse.")


class Wire(NamedTuple):
    """A row of a part: the pin of the Arduino, empty for none, and what it leads to."""

    pin: str
    at: str
    pulled: bool = False
    """A resistor keeps it low while the pin floats."""
    out: str = ""
    load: str = ""
    """Output of the part in this row, and what that leads to."""


Part = Tuple[str, Sequence[Wire]]


def _parts(model: models.RobotModel) -> List[Part]:
    """Return the parts of a robot with H-bridges; raise ConfigError if nothing here draws one of its pins."""
    chip, wheels = CHIPS[model.chip], WHEELS[: wiring.motors(model.board)]
    connected = {name: model.board.get(name, NOT_CONNECTED) for name in wiring.PIN_NAMES}
    pins = {name: chip.label(pin) for name, pin in connected.items() if pin != NOT_CONNECTED}
    found: List[Part] = [("Computer", [Wire("USB", "USB cable")])]
    for first in range(0, len(wheels), len(CHANNELS)):
        found.append(_bridge(BRIDGES[model.board["bridge"]], pins, first, wheels))
    encoders = [
        (name, f"{channel} of {_words(wheel)}")
        for wheel, names in zip(wheels, wiring.ENCODERS)
        for name, channel in zip(names, CHANNELS)
    ]
    echoes = [
        (f"pin_{mount.input}_{wire}", f"{wire.upper()[:4]} of {_words(name)}")
        for name, mount in model.sonars.items()
        for wire in ("trigger", "echo")
        if mount.type == "HC-SR04"
    ]
    bumpers = [(name, _words(wiring.short(name))) for name in wiring.STOP_INPUTS if "bumper" in name]
    divider = _wires(pins, [(wiring.BATTERY, "22 kΩ to battery +")])
    lower = [Wire(GROUND, f"10 kΩ and 100 nF to {wire.pin}") for wire in divider]
    bus = [Wire(chip.label(pin), f"{at}, by level shifter") for pin, at in zip(chip.bus, ("SDA", "SCL"))]
    others = (
        ("Encoders", _wires(pins, encoders), [Wire(POWER, "supply +"), Wire(GROUND, "supply −")]),
        ("HC-SR04", _wires(pins, echoes), [Wire(POWER, "VCC"), Wire(GROUND, "GND")]),
        ("Switches, closed when hit", _wires(pins, bumpers), [Wire(GROUND, "other end")]),
        ("Divider of the battery", divider, lower),
        ("IMU, optional", bus * model.board[wiring.I2C], [Wire(POWER, "VCC"), Wire(GROUND, "GND")]),
    )
    if pins:
        raise ConfigError(f"{model.name}: no part has {', '.join(pins)}; add it to {__name__}")
    return found + [(title, [*signals, *supply]) for title, signals, supply in others if signals]


def _wires(pins: Dict[str, str], rows: Sequence[Tuple[str, str]], pulled: bool = False) -> List[Wire]:
    """Take those functions out of `pins` that are there, given with what they lead to."""
    return [Wire(pins.pop(name), at, pulled) for name, at in rows if name in pins]


def _bridge(name: str, pins: Dict[str, str], first: int, wheels: Sequence[str]) -> Part:
    """Return the carrier of two motors, from this one on."""
    if name not in CARRIERS:
        raise ConfigError(f"bridge {name} has no picture, expected one of {', '.join(CARRIERS)}")
    inputs, powered, outputs, supply = CARRIERS[name]
    rows: List[Wire] = []
    for channel, functions, wheel in zip(CHANNELS, wiring.OUTPUTS[first:], wheels[first:]):
        named = [(name, each.format(channel)) for name, each in zip(functions, inputs)]
        wires = _wires(pins, named, pulled=True)
        loads = [(each.format(channel), f"{_words(wheel)} motor") for each in outputs]
        rows += [wire._replace(out=out, load=load) for wire, (out, load) in zip(wires, [*loads, ("", "")])]
    rows += [Wire(POWER, each) for each in powered]
    rows += [Wire(GROUND, "GND", out="GND", load="battery −"), Wire("", "", out=supply, load="battery +")]
    return f"{name.upper()} ({first // len(CHANNELS) + 1})", rows


def _words(name: str) -> str:
    return name.replace("_", " ")


def wiring_diagram(path: str) -> str:
    """Return the SVG of a robot's file."""
    model, y = models.load(path), 2 * ROW
    drawn: List[str] = []
    for title, rows in _parts(model):
        drawn += _part(title, rows, y)
        y += (len(rows) + 2) * ROW
    board = [_box(8, ROW, PIN_X - 8, y - ROW - 10), _text(14, ROW + 15, CHIPS[model.chip].board, "b")]
    notes = [_text(8, y + 14 + ROW * number, text) for number, text in enumerate(NOTES)]
    height = y + ROW * (len(NOTES) + 1) - 6
    size = f'width="{WIDTH}" height="{height}"'
    head = f"""\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" {size} role="img">
<title>Wiring of {model.name}</title>
<style>{STYLE}</style>
<rect class="card" {size}/>"""
    return "\n".join([head, *board, *drawn, *notes, "</svg>"]) + "\n"


def _part(title: str, rows: Sequence[Wire], y: int) -> Iterator[str]:
    """Yield a part with its wires; `y` is the top of its title."""
    loads = any(row.load for row in rows)
    yield _text(PART_X, y + 15, title, "b")
    yield _box(PART_X, y + ROW, PART_WIDTH - (LOAD_WIDTH + OUT) * loads, len(rows) * ROW)
    for number, row in enumerate(rows, 1):
        top, middle = y + number * ROW, y + number * ROW + ROW // 2
        if row.pin:
            kind = {POWER: "power", GROUND: "ground"}.get(row.pin, "signal")
            yield f'<path class="{kind}" d="M{PIN_X} {middle}H{PART_X}"/>'
            yield _text(PIN_X - 6, top + 15, row.pin, "e")
        if row.pulled:
            yield f'<circle cx="{PART_X - 24}" cy="{middle}" r="4"/>'
        if row.at:
            yield _text(PART_X + 6, top + 15, row.at)
        if row.load:
            x = PART_X + PART_WIDTH - LOAD_WIDTH
            kind = {"battery +": "power", "battery −": "ground"}.get(row.load, "signal")
            yield _box(x, top, LOAD_WIDTH, ROW) + f'<path class="{kind}" d="M{x - OUT} {middle}h{OUT}"/>'
            yield _text(x - OUT - 4, top + 15, row.out, "e") + _text(x + 6, top + 15, row.load)


def _box(x: int, y: int, width: int, height: int) -> str:
    return f'<rect class="box" x="{x}" y="{y}" width="{width}" height="{height}"/>'


def _text(x: int, y: int, words: str, kind: str = "s") -> str:
    return f'<text class="{kind}" x="{x}" y="{y}">{words}</text>'
