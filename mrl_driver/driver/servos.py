"""The servos on the pins of an H-bridge board, as `Driver.servos`; angles are those of the joints."""

from typing import Any, Dict, NamedTuple, Optional

from mrl_driver.arguments import require_number, shown
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.models import ServoMount
from mrl_driver.session.events import Lost, Ready, Stale

from .connection import Connection

_SET = BY_NAME["set_servo"].code
_CAPABILITY = BY_NAME["set_servo"].capability


class _Move(NamedTuple):
    """A move that began at `since_s` [s] on the driver's clock: pulses at both ends [us], and its speed [us/s]."""

    from_us: float
    to_us: float
    speed_us_s: float
    since_s: float

    def pulse_us(self, now_s: float) -> float:
        most = self.speed_us_s * max(0.0, now_s - self.since_s)
        return self.from_us + max(-most, min(most, self.to_us - self.from_us))


class Servos:
    """Turns the servos that the robot's file names."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._moves: Dict[str, _Move] = {}
        connection.on_state.append(self._forget)

    @property
    def mounts(self) -> Dict[str, ServoMount]:
        """The servos of the robot's model by name; empty until `connect` if the driver was created with `auto`."""
        model = self._connection.core.state.model
        return model.servos if model is not None else {}

    def move(self, name: str, angle_rad: float, speed_rad_s: Optional[float] = None) -> float:
        """Turn a servo, from where it is, and return the angle to which it turns; it holds that angle then.

        Its first move after the board's start is at once, because the board cannot know where it stands.  A stop of the
        motors does not stop it.  Do not use it on the reading thread.

        Args:
            angle_rad: counter-clockwise, or downward for one that tilts; limited to the range in the robot's file.
            speed_rad_s: limited to the speed in the file, which is also the default.

        Raises:
            ConfigError: the robot has no servo of this name, its board none at all, or a number is not finite; the
                robot was stopped.
            BoardTimeout: the board does not answer, or the pins that it has stored lack this servo.
            LinkLost: the port went away.
        """
        with self._connection.stop_if_refused():
            mount = self._mount(name)
            angle_rad = require_number("angle_rad", angle_rad)
            speed_rad_s = (
                mount.speed_rad_s if speed_rad_s is None else require_number("speed_rad_s", speed_rad_s)
            )
            self._require_servos()
        angle_rad = max(mount.low_rad, min(mount.high_rad, angle_rad))
        speed_us_s = max(1, round(min(abs(speed_rad_s), mount.speed_rad_s) * abs(mount.us_per_rad)))
        to_us = round(mount.pulse_us(angle_rad))
        _, from_us = self._connection.ask(_SET, mount.servo, to_us, speed_us_s)
        self._moves[name] = _Move(from_us, to_us, speed_us_s, self._connection.clock())
        return angle_rad

    @property
    def angles(self) -> Dict[str, float]:
        """Angle of each servo by name [rad], by the board's pulses: it does not measure them.

        A servo that has not been moved is left out, and so are all after a silence of the board, in which it may have
        held or released them.
        """
        now_s, mounts = self._connection.clock(), self.mounts
        return {
            name: mounts[name].angle_rad(move.pulse_us(now_s)) for name, move in dict(self._moves).items()
        }

    def _forget(self, event: object) -> None:
        if isinstance(event, (Lost, Stale, Ready)):
            self._moves.clear()

    def _mount(self, name: Any) -> ServoMount:
        mounts = self.mounts
        if not isinstance(name, str) or name not in mounts:
            expected = " or ".join(mounts) or "a robot with servos"
            raise ConfigError(f"name of the servo is {shown(name)}, expected {expected}")
        return mounts[name]

    def _require_servos(self) -> None:
        if _CAPABILITY not in self._connection.board.capabilities:
            raise ConfigError(
                "this board has no servos, expected firmware of the H-bridge build; flash it with: mrl flash"
            )
