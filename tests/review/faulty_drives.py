"""Twenty drives with one fault each, as `drives.Drive`; other seeds, robots and worlds give other drives."""

import math
from typing import Any, Dict, List, Sequence

from mrl_driver.robot import models
from sim_arduino.hardware.imu import ImuErrors

from .drives import Drive, User

IMU = {"imu": True}
_AT_S = 3.0
_NOISE = "noise=1e-5"  # Noise of wheels, as `models.ON_WHEELS`; tracks also slip a little in turns
_TRACK_NOISE = "noise=4e-5,turn_noise=2e-4"
_SONAR_NOISE = "noise=0.01,missed=0.01"
_USB = "delay:jitter=0.004"  # A USB adapter delivers bytes some milliseconds late, now and then 16 ms


def _real(robot: str, board: Dict[str, Any], faults: Sequence[str] = ()) -> Dict[str, Any]:
    """Options of a board with the noise that each robot has."""
    noise = _TRACK_NOISE if models.load(robot).body.tracks else _NOISE
    error = ",".join(filter(None, (noise, board.get("error", ""))))
    made = {"robot": robot, "sonar": _SONAR_NOISE, **board, "error": error}
    return {**made, "faults": tuple(faults)}


def _pauses(user: User) -> None:
    """A busy computer: it stops for a third of a second now and then."""
    for i in range(3):
        if user.once(f"pause {i}", 3.0 + 2.7 * i):
            user.robot.pause(0.35)


def _larger(name: str, factor: float) -> models.RobotModel:
    """The model with larger wheels than the robot has."""
    model = models.load(name)
    return model._replace(drive=model.base._replace(metres_per_count=factor * model.base.metres_per_count))


def _drifting(seed: int) -> ImuErrors:
    return ImuErrors.drawn(seed)._replace(gyro_walk=math.radians(0.6))


class _Maker:
    """Makes the drives of one seed, robot and world."""

    def __init__(self, seed: int, robot: str, world: str, duration_s: float) -> None:
        self._seed, self._robot, self._world, self._duration_s = seed, robot, world, duration_s
        self.sides = ("left", "right") if seed % 2 else ("right", "left")
        self.sonar = ("front", "left", "right")[seed % 3]
        self.at = f"at={_AT_S + seed % 3}"
        self.imu = {**IMU, "imu_seed": seed}

    def __call__(self, name, expected, *faults, board=None, **others):
        made = _real(self._robot, {"world": self._world, **(board or {})}, faults)
        return Drive(name, expected, made, seed=self._seed, **{"duration_s": self._duration_s, **others})


def faulty(
    seed: int = 1, robot: str = "traxbot", world: str = "room", duration_s: float = 13.0
) -> List[Drive]:
    """The drives; each is another one with another seed."""
    drive = _Maker(seed, robot, world, duration_s)
    (side, other), sonar, at, imu = drive.sides, drive.sonar, drive.at, drive.imu
    return [
        drive("dead sonar", ("sonar_dead",), f"sonar_failed:sonar={sonar},{at}"),
        drive("stuck sonar", ("sonar_stuck",), f"sonar_failed:sonar={sonar},state=stuck,at=3"),
        drive("slipping wheel", ("slip",), f"wheel_slips:wheel={side},grip=0.4,{at},lasts=4", board=imu),
        drive("sagging battery", ("battery_sag",), f"battery_sag:volts=3,{at}"),
        drive("empty battery", ("battery_empty", "battery_low"), board={"battery": 8.55}),
        drive("bad cable", ("bad_cable",), "flip:rate=0.0005"),
        drive("noise bursts", ("noise_bursts",), "junk:rate=2000,at=3,lasts=0.3,every=4"),
        drive("late host", ("late_host",), host=_pauses),
        drive("slow line", ("slow_line",), "delay:delay=0.04,jitter=0.02"),
        drive("lost link", ("link_lost",), f"unplug:{at},lasts=2"),
        drive("board restarts", ("board_restart", "brown_out"), f"brown_out:{at}"),
        drive(
            "watchdog stops",
            ("watchdog_stop", "requests_late"),
            f"stall:direction=to_board,{at},lasts=0.6,every=2.5",
        ),
        drive("motor board silent", ("motor_board",), f"motor_board_absent:{at}"),
        drive("dead encoder", ("encoder_dead", "wheel_dead"), f"encoder_open:wheel={side},{at}", board=imu),
        drive("reversed motor", ("wheel_reversed",), f"motor_reversed:wheel={side}"),
        drive(
            "blocked wheel", ("wheel_blocked", "wheel_dead"), f"wheel_blocked:wheel={other},{at}", board=imu
        ),
        drive("smaller wheels", ("wheel_size",), board={"error": "wheel_size=0.82"}, duration_s=28.0),
        drive("model of another size", ("speed_scale", "wheel_size"), robot=_larger(robot, 1.12)),
        drive("wrong track width", ("track_width",), board={**imu, "error": "axle=1.15"}, duration_s=24.0),
        drive("dead IMU", ("imu_dead",), f"imu_absent:{at}", board=imu),
        drive("drifting IMU", ("imu_drift",), board={**IMU, "imu_errors": _drifting(seed)}),
    ]


def good(seed: int = 1, robot: str = "traxbot", world: str = "room", duration_s: float = 6.0) -> Drive:
    """A drive without a fault; some have an IMU, some have the delays of a USB adapter."""
    board = {"world": world, **({**IMU, "imu_seed": seed} if seed % 3 == 1 else {})}
    made = _real(robot, board, (_USB,) if seed % 3 == 2 else ())
    return Drive(f"good {robot}", (), made, seed=seed, duration_s=duration_s)


def more(seed: int = 1, robot: str = "traxbot", world: str = "room", duration_s: float = 20.0) -> List[Drive]:
    """Other faults than the twenty."""
    drive = _Maker(seed, robot, world, duration_s)
    (side, other), sonar, at, imu = drive.sides, drive.sonar, drive.at, drive.imu
    id_of_other = models.load("stingbot" if robot == "traxbot" else "traxbot").ids[0]
    return [
        drive("swapped encoder", ("wheel_reversed",), f"encoder_swapped:wheel={other}"),
        drive(
            "smaller wheels and IMU", ("wheel_size", "track_width"), board={**imu, "error": "wheel_size=0.87"}
        ),
        drive(
            "larger wheels and IMU", ("wheel_size", "track_width"), board={**imu, "error": "wheel_size=1.15"}
        ),
        drive("deaf sonar", ("sonar_deaf",), f"sonar_failed:sonar={sonar},state=deaf"),
        drive("frozen IMU", ("imu_frozen",), f"imu_frozen:{at}", board=imu),
        drive("unequal wheels", ("wheel_ratio",), board={**imu, "error": "wheel_ratio=1.05"}),
        drive("lost datagrams", ("frames_lost",), "drop:rate=0.01,direction=to_host"),
        drive("lost requests", ("requests_lost",), "drop:rate=0.1,direction=to_board"),
        drive("debug text", ("debug_text",), "text:direction=to_host"),
        drive(
            "board stands still", ("board_silent", "board_stalled", "board_restart"), f"freeze:{at},lasts=1"
        ),
        drive("low battery", ("battery_low",), board={"battery": 9.0}),
        drive(
            "another robot's id",
            ("wrong_robot",),
            board={"robot_id": id_of_other},
            robot=robot,
            options={"any_id": True},
        ),
        drive("rare commands", ("command_gaps",), options={"command_timeout_s": 0.05}),
        drive("wheel off the ground", ("slip",), f"wheel_slips:wheel={side},grip=0", board=imu),
    ]
