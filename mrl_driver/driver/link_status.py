"""The link between the driver and its board, as `Driver.link`."""

import math

from mrl_driver.session.link_counters import Counters
from mrl_driver.transport.baud_rates import FAST_BAUD

from .connection import Connection


class LinkStatus:
    """Speed, delays and counters of the link; any thread may read them at any time."""

    def __init__(self, connection: Connection, baud: int) -> None:
        self._connection, self._baud = connection, baud

    @property
    def baud(self) -> int:
        """Current baud rate: 500000 if the option `fast` has raised it, else the port's baud rate."""
        return FAST_BAUD if self._connection.links.fast else self._baud

    @property
    def age_s(self) -> float:
        """Time since the last telemetry arrived; infinity before the first, and with the option `identify`."""
        connection = self._connection
        streams = connection.core.begun and not connection.identifies
        return connection.clock() - connection.core.session.heard_s if streams else math.inf

    @property
    def delay_s(self) -> float:
        """Time from a request to the board's answer [s]: a command takes less.  Measured once a second, with boards of
        2013 every 2 s.  NaN until then, and while the board is not ready.
        """
        core = self._connection.core
        return core.session.round_trip_s(self._connection.clock()) if core.begun else math.nan

    @property
    def since_pause_s(self) -> float:
        """How long ago this program went on after a pause of 0.25 s or longer [s]; infinity if it never stood still.

        Commands that come just after that may have waited in a queue; see `Options.queued_s`.
        """
        core = self._connection.core
        return self._connection.clock() - core.session.resumed_s if core.begun else math.inf

    @property
    def statistics(self) -> Counters:
        """Counters of the link; BoardTimeout before it is connected."""
        with self._connection.lock:
            return self._connection.core.statistics()
