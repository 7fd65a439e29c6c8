"""Links through pyserial's URLs: `rfc2217://host:port`, `spy:///dev/ttyACM0?file=log`, `loop://`.

Only this module and `link` use pyserial.  A thread copies the bytes that pyserial reads into a pipe, because some of
these links have no descriptor to wait for.
"""

import contextlib
import os
import threading
from typing import Optional

import serial

from mrl_driver.errors import LinkError, LinkLost, PortMissing
from mrl_driver.protocol.table import BAUD

from .address import scheme_of
from .link import READ_SIZE, WRITE_TIMEOUT_S, DescriptorLink

_POLL_S = 0.05


class UrlLink(DescriptorLink):
    """A link that pyserial opens from a URL.

    Raises:
        ConfigError: the URL's scheme is unknown.
        PortMissing: the URL cannot be opened.
        LinkError: pyserial does not understand the URL, or refuses the baud rate.
    """

    def __init__(self, port: str, baud: int = BAUD) -> None:
        self._failure, self.closed = "hung up", False
        with contextlib.ExitStack() as undo:
            self._serial = _open(port, baud)
            undo.callback(self._serial.close)
            out, self._into = os.pipe()
            undo.callback(os.close, out)
            undo.callback(os.close, self._into)
            os.set_blocking(out, False)
            self._feeder = threading.Thread(target=self._feed, name="mrl-url", daemon=True)
            self._feeder.start()
            undo.pop_all()  # `_begin` and the thread close them
        try:
            self._begin(port, out)
        except BaseException:
            self._feeder.join(1.0)
            raise

    def _feed(self) -> None:
        """Copy arriving bytes into the pipe until the link is closed or the port goes away."""
        try:
            while not self.closed:
                data = self._serial.read(1)
                if data:
                    waiting = min(self._serial.in_waiting, READ_SIZE)
                    os.write(self._into, data + (self._serial.read(waiting) if waiting else b""))
        except Exception as error:  # noqa: BLE001 - pyserial's handlers raise whatever theirs do
            self._failure = _words(error)
        finally:
            os.close(self._into)

    def _send(self, data: bytes) -> None:
        """Send all of `data`; pyserial's handler decides how long it may block."""
        if self.closed:
            raise LinkLost(f"{self.port} is closed")
        try:
            self._serial.write(data)
        except serial.SerialTimeoutException:
            raise self._stalled() from None
        except Exception as error:  # noqa: BLE001 - as in _feed
            raise self._lost(_words(error)) from None

    def set_baud(self, baud: int) -> None:
        try:
            self._serial.baudrate = baud
        except Exception as error:  # noqa: BLE001 - as in _feed
            raise self._lost(_words(error)) from None

    def _end_of_data(self) -> None:
        raise self._lost(self._failure)

    def _give_back(self) -> None:
        self._feeder.join(1.0)
        os.close(self._fd)
        try:
            self._serial.close()
        except Exception:  # noqa: BLE001 - it is given up anyway
            return

    def _release(self) -> None:
        """In a forked child: pyserial's `close` would also end the parent's connection."""
        if "_socket" in vars(self._serial):
            vars(self._serial)["_socket"] = None
        else:
            self._serial.close()
        os.close(self._fd)


def _open(port: str, baud: int) -> serial.Serial:
    scheme = scheme_of(port)
    try:
        end = serial.serial_for_url(port, baud, timeout=_POLL_S, do_not_open=True)
        if scheme != "rfc2217":
            end.write_timeout = WRITE_TIMEOUT_S
        end.open()
        return end
    except (ValueError, KeyError, AttributeError) as error:
        raise LinkError(
            f"{port}: pyserial does not take it ({_words(error)}); check the URL and baud {baud}"
        ) from None
    except (serial.SerialException, OSError) as error:
        raise PortMissing(
            f"{port} cannot be opened ({_words(error)}): check the address and what is there"
        ) from None


def _words(error: Optional[BaseException]) -> str:
    return " ".join(str(error).split()) or type(error).__name__
