"""A kit with an H-bridge board, in simulated time: its cables are wired as `hidden` says, and its board may not know.

It has no physics: a wheel turns at once with the share of full speed of its duty.  The pose is exact.
"""

import math
from typing import Dict, Tuple

import pytest

from mrl_driver.apps.calibration.wiring_check import BITS
from mrl_driver.cli import main
from mrl_driver.geometry import ORIGIN
from mrl_driver.protocol.table import BY_NAME, PARAMETERS
from mrl_driver.robot import models
from tests.fake_board import FakeBoard

MODEL = models.load("duo")


def calibrate(capsys, *args):
    """Run `mrl calibrate`; exit code, stdout, lines of stderr."""
    with pytest.raises(SystemExit) as ended:
        main.main(["calibrate", *map(str, args)])
    out, err = capsys.readouterr()
    assert "Traceback" not in err
    return ended.value.code or 0, out, err.strip().splitlines()


_NAMES = ("move_motors", "read_wiring", "read_config", "write_config", "save_config", "default_config")
_CODES = {BY_NAME[name].code: name for name in _NAMES}
_REVERSED = {
    "motor": (BITS["left_motor_reversed"], BITS["right_motor_reversed"]),
    "encoder": (BITS["left_encoder_reversed"], BITS["right_encoder_reversed"]),
}


def _crossed(wiring: int, bit: str, pair: Tuple[float, float]) -> Tuple[float, float]:
    return (pair[1], pair[0]) if wiring & BITS[bit] else pair


def _signed(wiring: int, part: str, pair: Tuple[float, float]) -> Tuple[float, float]:
    left, right = (-each if wiring & bit else each for each, bit in zip(pair, _REVERSED[part]))
    return left, right


def driven(wiring: int, wheels: Tuple[float, float]) -> Tuple[float, float]:
    """Duties of the outputs, left and right, that drive the wheels of a kit with this wiring so."""
    return _crossed(wiring, "motors_swapped", _signed(wiring, "motor", wheels))


def turned_by(wiring: int, outputs: Tuple[float, float]) -> Tuple[float, float]:
    """Speeds of the wheels when the outputs have these duties."""
    return _signed(wiring, "motor", _crossed(wiring, "motors_swapped", outputs))


def counted(wiring: int, wheels: Tuple[float, float]) -> Tuple[float, float]:
    """Counts at the inputs, left and right, when the wheels turn so."""
    return _crossed(wiring, "encoders_swapped", _signed(wiring, "encoder", wheels))


def understood(wiring: int, inputs: Tuple[float, float]) -> Tuple[float, float]:
    """Counts of the wheels that a board with this wiring makes of those at its inputs."""
    return _signed(wiring, "encoder", _crossed(wiring, "encoders_swapped", inputs))


class Kit(FakeBoard):
    """The board and the robot; an engine for `SteppedDriver`.  `saved` are the parameters in its EEPROM."""

    def __init__(self, hidden: int = 1, **board: int) -> None:
        values: Dict[str, int] = {**models.COMMON_BOARD, **MODEL.board, "robot_id": MODEL.ids[0]}
        self.saved = {**values, "bridge": 0, "wiring": 0, **board}
        self.hidden = hidden
        self.problem = (0, -1, -1)  # of the pins
        self.dead_inputs: Tuple[int, ...] = ()
        self.stuck_outputs: Tuple[int, ...] = ()
        self.on_move = lambda: None
        self.seen = []
        self.next_event_s = 0.0
        self.pose = ORIGIN
        super().__init__(robot_id=self.saved["robot_id"])
        self.capabilities |= {"bridge", "no_battery", "no_temperature"}
        self.battery = self.temperature = 0

    def reset(self, now: float) -> None:
        super().reset(now)
        self.config, self.percents = dict(self.saved), (0.0, 0.0)

    @property
    def set(self) -> bool:
        return bool(self.config["bridge"] and self.config["wiring"] & BITS["set"])

    def receive(self, data: bytes, now: float = math.nan) -> None:
        super().receive(data, self.time_s if math.isnan(now) else now)
        self.next_event_s = self.time_s

    def advance(self, now: float) -> bytes:
        dt, inputs = now - self.time_s, (0.0, 0.0)
        if any(self.percents):
            full_m_s = self.config["full_speed"] / 60 * math.pi * 0.065
            duties = [0.0 if i in self.stuck_outputs else each for i, each in enumerate(self._outputs())]
            wheels = turned_by(self.hidden, (duties[0], duties[1]))
            left_m, right_m = (share / 100 * full_m_s * dt for share in wheels)
            yaw_rad = (right_m - left_m) / MODEL.drive.wheel_separation_m
            self.pose = self.pose.compose((left_m + right_m) / 2, 0.0, yaw_rad)
            inputs = counted(self.hidden, (left_m, right_m))
            inputs = tuple(0.0 if i in self.dead_inputs else each for i, each in enumerate(inputs))
        left_m, right_m = understood(self.config["wiring"], inputs)
        self.left += left_m / MODEL.drive.metres_per_count
        self.right += right_m / MODEL.drive.metres_per_count
        self.speeds = (0, 0)
        out = super().advance(now)
        self.next_event_s = self.due_s if self.period_s is not None else now + 0.01
        return out

    def _outputs(self) -> Tuple[float, float]:
        return driven(self.config["wiring"], self.percents)

    def _do(self, frame, now) -> None:
        name, args = _CODES.get(frame.code), frame.args
        if frame.code in (13, 11):
            self.percents = (0.0, 0.0)
        if name == "move_motors":
            self.percents = (args[0], args[1]) if self.set else (0.0, 0.0)
            self.seen.append(args)
            self.on_move()
        elif name == "read_config":
            self._say(frame.code, args[0], self.config[PARAMETERS[args[0]].name])
        elif name == "read_wiring":
            self._say(frame.code, *self.problem)
        elif name == "write_config":
            self.config[PARAMETERS[args[0]].name] = args[1]
            self.robot_id = self.config["robot_id"]
            self._say(frame.code, *args)
        elif name == "default_config":
            self.config.update(models.COMMON_BOARD)
            self._say(frame.code, 1)
        elif name == "save_config":
            self.saved = dict(self.config)
            self._say(frame.code, 1)
        else:
            super()._do(frame, now)
