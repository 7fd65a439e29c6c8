"""What lines carry: Bluetooth serial ports, radios in transparent mode, old adapters; and cables that may be faster.

Pure.
"""

import math
from typing import Any

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BAUDS

from .address import is_url

FULL_BAUD = 115200
"""From here on the board itself sets the pace."""
FAST_BAUD = BAUDS[2]
"""What a line is raised to."""
SLOW = "the board knows no other speed, or errors showed: update its firmware, or check cable and adapter"
"""Why a line may not be raised, and what to do."""
FRAME_BYTES, COMMAND_BYTES = 50, 24
"""A frame of the stream with stamp, check value and line end, and a motion command, both nearly as long as they get."""
BYTE_BITS = 10
SHARE = 0.7
"""Of the line that the stream may take; answers to the poll take some 110 bytes a second."""
COMMAND_SHARE = 0.5


def least_period_ms(baud: int) -> int:
    """The shortest period of the stream that leaves the line air to breathe [ms]; 0 for any, on a fast line.

    19 ms at 38400 baud, 38 at 19200, 75 at 9600.
    """
    return 0 if baud >= FULL_BAUD else math.ceil(1000 * BYTE_BITS * FRAME_BYTES / (baud * SHARE))


def command_gap_s(baud: int) -> float:
    """The least time between two commands, so that none waits in a buffer behind older ones [s]."""
    return BYTE_BITS * COMMAND_BYTES / (baud * COMMAND_SHARE)


def demand_raisable(port: Any, baud: int) -> None:
    """See to it that a port is one whose speed can be raised.

    Raises:
        ConfigError: it is an URL or an open link, or begins at another speed than the board.
    """
    if not isinstance(port, str) or is_url(port):
        raise ConfigError(
            f"fast is given with port {port}, expected a device name: the bridge sets the speed behind it"
        )
    if baud != FULL_BAUD:
        raise ConfigError(f"fast is given with baud {baud}, expected {FULL_BAUD}, at which the board begins")
