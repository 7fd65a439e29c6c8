"""Limits of slow lines (Bluetooth serial ports, radios in transparent mode, old adapters), and of faster cables.

This module does no I/O.
"""

import math
from typing import Any

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BAUD, BAUDS

from .address import is_url

FAST_BAUD = BAUDS[2]  # raised baud rate of a serial link
SLOW = "the board knows no other speed, or errors showed: update its firmware, or check cable and adapter"
"""Why a link could not be raised to a higher baud rate, and what to do."""
FRAME_BYTES, COMMAND_BYTES = 50, 24
"""Nearly the longest stream frame (with stamp, checksum and line end) and the longest motion command [byte]."""
IMU_BYTES = 60  # usual length of an IMU's frame [byte]
SLOWEST_IMU_MS = 40
"""Longest period of the IMU's stream [ms]: the gyro's filter passes 42 Hz, and a reading may be lost."""
SLOWEST_BAUD = 4800
"""Slowest link [Bd].  On a slower one the time between two stream frames comes near 280 ms, after which telemetry is
stale."""
BYTE_BITS = 10
SHARE = 0.7
"""Share of the link's capacity for the stream; the replies to polling need about 110 bytes a second."""
COMMAND_SHARE = 0.5


def least_period_ms(baud: int) -> int:
    """Return the shortest stream period that keeps to `SHARE` of the link [ms]; 0 (any period) on a fast link.

    19 ms at 38400 baud, 38 at 19200, 75 at 9600.
    """
    return 0 if baud >= BAUD else math.ceil(1000 * BYTE_BITS * FRAME_BYTES / (baud * SHARE))


def least_imu_period_ms(baud: int, stream_ms: int) -> int:
    """Return the shortest period of the IMU's stream next to a stream of counters of period `stream_ms` [ms], within
    `SHARE` of the link; 0 if there is no room for `SLOWEST_IMU_MS`.

    10 ms on a fast link, where the IMU's frames wait for the others.
    """
    if baud >= BAUD:
        return 10
    room = baud / BYTE_BITS * SHARE - 1000 * FRAME_BYTES / stream_ms
    return math.ceil(1000 * IMU_BYTES / room) if room * SLOWEST_IMU_MS >= 1000 * IMU_BYTES else 0


def command_gap_s(baud: int) -> float:
    """Return the minimum time between two commands, so that no command waits in a buffer behind older ones [s]."""
    return BYTE_BITS * COMMAND_BYTES / (baud * COMMAND_SHARE)


def require_raisable(port: Any, baud: int) -> None:
    """Check that the speed of the port can be raised.

    Raises:
        ConfigError: the port is a URL or an open link, or `baud` is not the rate at which the board starts.
    """
    if not isinstance(port, str) or is_url(port):
        raise ConfigError(
            f"fast is given with port {port}, expected a device name: the bridge sets the speed behind it"
        )
    if baud != BAUD:
        raise ConfigError(f"fast is given with baud {baud}, expected {BAUD}, at which the board begins")
