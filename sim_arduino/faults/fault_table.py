"""The faults by name, and the parser of their command line form: `loss:rate=0.001,burst=3`."""

from typing import Dict, NamedTuple, Tuple, Union

from mrl_driver.errors import ConfigError
from mrl_driver.yaml_file import short

from . import hardware_faults, line_faults  # noqa: F401 - they fill the table
from .fault_kind import FOREVER_S, KINDS, FaultKind
from .key_values import Key, pairs, values_of

TO_BOARD, TO_HOST, BOTH = "to_board", "to_host", "both"


class Fault(NamedTuple):
    """A fault to inject."""

    kind: FaultKind
    values: Dict[str, Union[float, str]]
    direction: str
    window: Tuple[float, float, float]


_OF_BOARD = (
    FaultKind("unplug", "the port disappears, and returns with another name", at_s=1.0, lasts_s=1.0),
    FaultKind("freeze", "the board stops running, its motor board does not", at_s=1.0, lasts_s=1.0),
    FaultKind("reset", "the board is reset", at_s=1.0, lasts_s=0.01),
    FaultKind("brown_out", "the board is reset, because its supply voltage dropped", at_s=1.0, lasts_s=0.01),
)
FAULTS = {
    kind.name: kind for kind in sorted((*KINDS.values(), *_OF_BOARD), key=lambda kind: bool(kind.switch))
}
"""All faults by name: those of the serial link and the board, then those of the hardware."""
_SHARED = (
    Key("at", 0.0, 0.0, FOREVER_S, "start", "s"),
    Key("lasts", FOREVER_S, 0.001, FOREVER_S, "duration", "s"),
    Key("every", 0.0, 0.001, FOREVER_S, "repeat after this time; default: once", "s"),
)
_DIRECTION = Key("direction", BOTH, None, 0.0, "direction", choices=(BOTH, TO_BOARD, TO_HOST))


def usage() -> str:
    """All faults with their parameters, one per line, as `mrl-sim --help` prints them."""
    lines = []
    for kind in FAULTS.values():
        lines.append(f"{kind.name}: {kind.text}")
        lines += [f"    {key.line}" for key in kind.parameters]
    lines.append(
        "All faults take at (start), lasts (duration) and every (repeat after) [s].\n"
        "Faults of the serial link take direction=both, to_board or to_host."
    )
    return "\n".join(lines)


def parse(spec: str) -> Fault:
    """The fault in `name:key=value,key=value`; absent keys have their defaults.  ConfigError if it is none."""
    name, _, rest = spec.partition(":")
    kind = FAULTS.get(name.strip())
    if kind is None:
        raise ConfigError(f"fault {short(name)} is unknown, expected {', '.join(FAULTS)}")
    shared = (_SHARED[0]._replace(default=kind.at_s), _SHARED[1]._replace(default=kind.lasts_s), _SHARED[2])
    keys = (*kind.parameters, *shared, *([_DIRECTION] if kind.make else []))
    values = values_of(f"fault {short(spec)}", pairs(rest), keys)
    direction = values.pop("direction", BOTH)
    window = values.pop("at"), values.pop("lasts"), values.pop("every")
    return Fault(kind, values, direction, window)
