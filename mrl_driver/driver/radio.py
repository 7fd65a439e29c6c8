"""The board's XBee radio, as `Driver.radio`; texts have 1 to 16 characters."""

from typing import Callable, List, Optional, Union

from mrl_driver.arguments import require_number
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.robot.hold import RELEASE, Hold
from mrl_driver.robot.radio import (
    CAPABILITY,
    DISCOVERY_S,
    SEARCH,
    RadioNode,
    RadioText,
    Request,
    text_request,
)

from .connection import Connection


class Radio:
    """Sends and receives texts, and finds other radios."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def send(self, address: int, text: Union[str, bytes]) -> None:
        """Send 1 to 16 ASCII characters, or bytes, to the radio with this 64-bit address.

        `mrl_driver.robot.radio.BROADCAST` is the address of all.

        Texts follow each other as fast as the radio's line allows, about 30 in a second.  A text may be lost on the
        air: let the receiver answer if it matters.

        Raises:
            FrameError: address or text is not valid; the robot was stopped.
            ConfigError: the board has no radio.
            MrlError: too many texts wait already.
            LinkLost: the port went away.
        """
        with self._connection.stop_if_refused():
            request = text_request(address, text)
        self._send(request)

    def discover(self, duration_s: float = DISCOVERY_S) -> List[RadioNode]:
        """Search for other radios, and return those that answer within `duration_s`, in the order of their answers.

        An XBee collects answers for 6 s.  Do not use it on the reading thread.

        Raises:
            ConfigError: the board has no radio.
            LinkLost: the port went away, or the driver was closed.
            MrlError: another search is under way, or too many texts wait already.
        """
        connection = self._connection
        with connection.stop_if_refused():
            duration_s = require_number("duration_s", duration_s)
        core = connection.core
        with connection.lock:
            if core.nodes is not None:
                raise MrlError("a search for radios is under way; try again when it has ended")
            core.nodes = {}
        try:
            self._send((SEARCH,))
            connection.wait(duration_s)
            connection.connected()
            with connection.lock:
                return list(core.nodes.values())
        finally:
            with connection.lock:
                core.nodes = None

    def require(self) -> None:
        """Raise ConfigError if the board has no radio."""
        if CAPABILITY not in self._connection.board.capabilities:
            raise ConfigError(
                "this board has no radio, expected firmware of the radio build; flash it with: mrl flash --build xbee"
            )

    @property
    def hold(self) -> Optional[Hold]:
        """Whether other robots hold this one by radio; None without a radio, or before the board has said so.

        After a hold, the robot waits for a new command.
        """
        return self._connection.core.hold

    def release_hold(self) -> bool:
        """Drop the robots that hold this one and have fallen silent; True if it is free of holds.

        Look first whether the place is free: a silent robot may stand there.  One that still speaks is not dropped.

        Raises:
            ConfigError: the board cannot be held by radio.
            BoardTimeout: the board does not answer.
            LinkLost: the port went away.
        """
        if HOLD not in self._connection.board.capabilities:
            raise ConfigError(
                "the board cannot be held by radio, expected firmware of the radio build: mrl flash"
            )
        return self._connection.ask(RELEASE) == (0,)

    def on_text(self, callback: Callable[[RadioText], None]) -> None:
        """Call `callback` for each text that the radio receives; one of more than 16 bytes comes in pieces."""
        self._connection.listen(self._connection.listeners[RadioText], callback)

    def _send(self, request: Request) -> None:
        connection = self._connection
        core = connection.connected()
        self.require()
        with connection.lock:
            connection.require_link()
            core.send_by_radio(request, connection.clock())
        connection.flush()
