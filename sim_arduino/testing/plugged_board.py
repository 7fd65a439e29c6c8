"""A bare board on a port in place of an emulated one: the same tests, hardware in the loop."""

from typing import Any, Callable, Mapping

import pytest

from mrl_driver.driver.probe import probe
from mrl_driver.errors import ConfigError
from mrl_driver.host.firmware_images import VIRTUAL_MODEL

from .emulated_board import PATIENCE_S, wait_until


class PluggedBoard:
    """A board that calculates its robot; a test that asks for what only an emulated one has is skipped.

    Attributes:
        port: Its serial port.
    """

    def __init__(self, port: str, options: Mapping[str, Any]) -> None:
        """`options` are those of the test's marker."""
        for name, value in options.items():
            if (name, value) != ("robot", VIRTUAL_MODEL):
                pytest.skip(
                    f"{name}={value!r} is for an emulated board; a bare one is a {VIRTUAL_MODEL} in its own room"
                )
        self.port = port

    def wait_until(
        self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S, what: str = ""
    ) -> None:
        """As that of `EmulatedBoard`."""
        wait_until(condition, timeout_s, lambda: what or "the condition")

    def __getattr__(self, name: str) -> Any:
        pytest.skip(f"{name} is that of an emulated board; a bare one has port and wait_until")


def require_bare(port: str) -> str:
    """Return the port of a board that calculates its robot; raise ConfigError for any other: a test may drive."""
    answer = probe(port)
    if "virtual" not in answer.capabilities:
        got = answer.error or f"robot {answer.robot_id}, which is real"
        raise ConfigError(
            f"--port {port} has {got}, expected a bare board: mrl flash --build virtual --port {port}"
        )
    return port
