"""From `mrl new` to a closed square with hidden errors, and an IMU's calibration, in simulated time."""

import contextlib
import json
import math
import pathlib
from unittest.mock import Mock

import numpy as np
import pytest
import yaml

from mrl_driver.apps.calibration import calibration_files, ground_truth, manoeuvres
from mrl_driver.apps.calibration.commands import calibrate_job
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.trial import Trial, errors
from mrl_driver.apps.calibration.wiring_check import BITS
from mrl_driver.cli import main
from mrl_driver.cli.commands import set_id
from mrl_driver.driver.options import Options
from mrl_driver.driver.parameters import Parameters
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, OutputError
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.robot import models, wiring
from mrl_driver.robot.models import ImuMount, kit
from mrl_driver.robot.models.kit import text_of
from mrl_driver.yaml_form import with_schema_line
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.serve import factory
from tests.conftest import EXPLORE
from tests.models import four_wheel_kit, four_wheels, without_encoders
from tests.wirings import rows

from .kit import calibrate

SIDE_M, END_M, END_RAD = 0.3, 0.01, math.radians(0.5)
BEFORE_M = 0.03  # The hidden errors put a square off by more than this
HIDDEN = 54  # Motors and encoders swapped, left motor and left encoder reversed
FACTS = ("--wheel-diameter", 65, "--separation", 150, "--counts", "11x4x34")
_GEOMETRY = (("straight", "--count", 2, "--distance", 0.5), ("umbmark", "--laps", 2, "--side", SIDE_M))
DUO = ("--wiring", "mrl_duo", "--bridge", "tb6612")


class Later:
    """An engine whose time has begun before."""

    def __init__(self, engine, now_s):
        self._engine, self._since_s, self.now_s = engine, now_s, now_s

    @property
    def next_event_s(self):
        return self._engine.next_event_s - self._since_s

    def receive(self, data):
        self._engine.receive(data)

    def advance(self, to_s):
        self.now_s = self._since_s + to_s
        return self._engine.advance(self.now_s)


class Workshop:
    """One emulated kit, and the command line."""

    def __init__(
        self, capsys, robot="duo", hidden=HIDDEN, error="wheel_ratio=1.04,axle=1.02", engine="python"
    ):
        self.emulated = factory.make(
            factory.Options(robot=robot, wiring=hidden, error=error, footprint="none", engine=engine)
        )
        self._capsys, self._now_s = capsys, 0.0

    @contextlib.contextmanager
    def robot(self, model, **options):
        engine = Later(self.emulated.engine, self._now_s)
        try:
            with SteppedDriver(engine, model, Options(**options)) as driver:
                yield driver
        finally:
            self._now_s = engine.now_s

    def pose(self):
        return Pose(*self.emulated.plant.true_pose)

    def mrl(self, *args):
        """Run `mrl`; its output."""
        with pytest.raises(SystemExit) as ended:
            main.main(list(map(str, args)))
        out, err = self._capsys.readouterr()
        assert not ended.value.code, err
        return out

    def square_error(self, model):
        """Error of the odometry after a clockwise square: metres and radians."""
        with self.robot(model, period_ms=50) as robot:
            track, ruler = manoeuvres.Track(robot), Truth(self.pose)
            track.begin()
            ruler.begin("")
            manoeuvres.square(robot, SIDE_M, False, manoeuvres.Speeds())
            steps = manoeuvres.steps_of(track.rows())
            off = errors(robot.model.differential, [Trial(steps, ruler.end("", lambda _: None))])[0]
            return float(np.hypot(*off[:2])), abs(float(off[2]))


@pytest.fixture
def workshop_of(monkeypatch, tmp_path, capsys):
    """Makes the workshop of a kit."""
    with contextlib.ExitStack() as stack:

        def make(*kit):
            made = Workshop(capsys, *kit)
            stack.callback(made.emulated.close)
            monkeypatch.chdir(tmp_path)
            monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
            monkeypatch.setattr(
                calibrate_job, "connect", lambda job, **_: made.robot(job.target.model, period_ms=20)
            )
            monkeypatch.setattr(
                set_id, "connected", lambda target, model, any_id, **_: made.robot(model, any_id=any_id)
            )
            monkeypatch.setattr(ground_truth, "truth_file", lambda path: made.pose)
            return made

        yield make


@pytest.fixture
def workshop(workshop_of):
    return workshop_of()


def test_an_unknown_kit_becomes_a_calibrated_robot(workshop, tmp_path):
    """Wires swapped, one wheel 4 % larger, axle 2 % wider: `mrl new`, two calibrations, and the square closes."""
    out = workshop.mrl(
        "new", "rover", *FACTS, *DUO, "--no-flash", "--port", "tcp://kit:1", "--truth", "t", "--yes"
    )
    assert f"wiring {HIDDEN | 1}, stored in the board's EEPROM" in out
    path = str(tmp_path / "config" / "mrl-driver" / "robots" / "rover.yaml")
    before_m, _ = workshop.square_error("rover")
    for procedure in _GEOMETRY:
        workshop.mrl("calibrate", *procedure, "--robot", path, "--truth", "t", "--yes", "--eeprom")
    after_m, after_rad = workshop.square_error("rover")
    assert before_m > BEFORE_M and after_m < END_M and after_rad < END_RAD
    with workshop.robot("rover") as robot:
        stored = robot.parameters.read("robot_id", "wiring", "kp", "wheel_radius")
        board = models.load("rover").board
    assert stored == {
        "robot_id": 11,
        "wiring": HIDDEN | 1,
        "kp": board["kp"],
        "wheel_radius": board["wheel_radius"],
    }


SINGLE = 22 | 128  # Encoders with one channel; motors and encoders swapped, left motor reversed
OPEN_LOOP = 6  # No encoders; motors swapped, left motor reversed
CLOSED_M = 0.03  # From the start of a square to its end
CLOSED_BY_TIME_M, CLOSED_BY_TIME_RAD = 0.1, 0.3  # The same by time and speed alone: 5 % of a whole turn


def kit_file(row, folder):
    """The robot's file of a duo with these pins."""
    file = yaml.safe_load(pathlib.Path(models.path_of("duo")).read_text(encoding="utf-8"))
    file["wiring"] = {"chip": row.chip.name, **wiring.section(row.pins, row.chip)}
    file["board"]["bridge"], file["sonars"] = row.bridge, {}
    path = folder / "kit.yaml"
    path.write_text(yaml.safe_dump(file))
    return str(path)


def square_by_time(robot, side_m, left, speeds):
    """A square without odometry: each side and corner takes the time that its speed needs."""
    angular_rad_s = speeds.angular_rad_s if left else -speeds.angular_rad_s
    for _ in range(4):
        for command, seconds in (
            ((speeds.linear_m_s, 0.0), side_m / speeds.linear_m_s),
            ((0.0, angular_rad_s), math.pi / 2 / speeds.angular_rad_s),
        ):
            for wanted, ticks in ((command, seconds / manoeuvres.TICK_S), ((0.0, 0.0), 10)):
                for _ in range(round(ticks)):
                    robot.drive(*wanted)
                    robot.wait(manoeuvres.TICK_S)


ON_THE_CHIP = ("l298_spi_encoder", "l298_mega_d4_d5_d10_d11", "l298_single_channel")
"""Wirings of each kind of encoder; the conformance tests drive all of them on the image."""


def channels(row):
    """Channels of each encoder."""
    return 0 if row.pins["no_encoders"] else 1 if row.pins["pin_left_encoder_b"] == -1 else 2


def driven():
    """The rows that drive: with a seed all of them, else one on the chip, and one of each kind of encoder."""
    by_name = {row.name: row for row in rows() if row.verdict == "drives"}
    found = [(by_name[name], "avr") for name in (ON_THE_CHIP if EXPLORE else ON_THE_CHIP[:1])]
    some = {channels(row): row for row in by_name.values()}
    found += [(row, "python") for row in (by_name if EXPLORE else some).values()]
    return [pytest.param(row, engine, id=f"{row.name}-{engine}") for row, engine in found]


@pytest.mark.parametrize("row, engine", driven())
def test_each_wiring_that_drives_closes_a_square(row, engine, workshop_of, tmp_path):
    """From `mrl new` on, with motors and encoders swapped; nothing is rewired."""
    by_time = bool(row.pins["no_encoders"])
    hidden = (OPEN_LOOP, SINGLE, HIDDEN)[channels(row)]
    workshop = workshop_of(kit_file(row, tmp_path), hidden, "", engine)
    given = wiring.section(row.pins, row.chip).items()
    pins = [word for name, pin in given if name not in wiring.FLAGS for word in ("--pin", f"{name}={pin}")]
    flags = [f"--{name.replace('_', '-')}" for name in wiring.FLAGS if row.pins[name]]
    counts, board = () if by_time else FACTS[4:], row.board.lower()
    facts = (*FACTS[:4], *counts, "--board", board, "--bridge", row.bridge, *pins, *flags)
    out = workshop.mrl("new", "rover", *facts, "--no-flash", "--port", "tcp://kit:1", "--truth", "t", "--yes")
    assert f"wiring {hidden | 1}, stored in the board's EEPROM" in out
    with workshop.robot("rover", period_ms=50) as robot:
        start = workshop.pose()
        (square_by_time if by_time else manoeuvres.square)(robot, SIDE_M, False, manoeuvres.Speeds())
        end = workshop.pose()
        names = [each.name for each in wiring.rows(row.chip)]
        assert wiring.of_board(robot.parameters.read(*names)) == row.pins
    most_m, most_rad = (CLOSED_BY_TIME_M, CLOSED_BY_TIME_RAD) if by_time else (CLOSED_M, 0.05)
    assert math.dist(start[:2], end[:2]) < most_m and abs(wrap_angle(end.yaw_rad - start.yaw_rad)) < most_rad


NO_FLASH = ("--no-flash", "--port", "tcp://kit:1", "--truth", "t", "--yes")
DISC = 40.0  # Counts of a turn of a disc with 20 slots, by one channel: 5 mm each
ONE_CHANNEL = {
    "left_pwm_a": 9,
    "left_pwm_b": 8,
    "left_logic": 7,
    "right_pwm_a": 10,
    "right_pwm_b": 5,
    "right_logic": 4,
    "left_encoder_a": 2,
    "right_encoder_a": 3,
}


def disc_kit(folder, bridge, rpm, no_encoders=False):
    """The file of a robot whose wheels carry slotted discs, or nothing, and the options of `mrl new` for it."""
    wires = {name: pin for name, pin in ONE_CHANNEL.items() if not (no_encoders and "encoder" in name)}
    pins = {f"pin_{name}": pin for name, pin in wires.items()}
    table = wiring.of_board({**pins, "no_encoders": int(no_encoders)})
    path = folder / "kit.yaml"
    text = text_of(kit.Kit("kit", 40, 65.0, 150.0, DISC, bridge, table))
    path.write_text(text.replace("full_speed: 170", f"full_speed: {rpm}"))
    words = [word for name, pin in wires.items() for word in ("--pin", f"{name}={pin}")]
    counts = ("--no-encoders",) if no_encoders else ("--counts", "20x2")
    return str(path), (*FACTS[:4], *counts, "--bridge", bridge, *words, *NO_FLASH)


@pytest.mark.parametrize("rpm", [100, 200] if EXPLORE else [100])
def test_wheels_with_slotted_discs_close_a_square(rpm, workshop_of, tmp_path):
    """At the slowest speeds of a corner a wheel has no count for a third of a second, and is not taken for dead."""
    path, facts = disc_kit(tmp_path, "tb6612", rpm)
    workshop = workshop_of(path, SINGLE, "")
    workshop.mrl("new", "rover", *facts)
    with workshop.robot("rover", period_ms=50) as robot:
        start = workshop.pose()
        manoeuvres.square(robot, SIDE_M, False, manoeuvres.Speeds())
        assert math.dist(start[:2], workshop.pose()[:2]) < CLOSED_M
        assert robot.parameters.read("full_speed")["full_speed"] == pytest.approx(rpm, rel=0.1)


def test_wheels_that_the_board_cannot_control_with_their_discs_are_named(workshop_of, tmp_path, capsys):
    path, facts = disc_kit(tmp_path, "tb6612", 77)
    workshop_of(path, SINGLE, "").emulated.plant.robot.set_battery(8.0)
    with pytest.raises(SystemExit) as ended:
        main.main(["new", "rover", *map(str, facts)])
    assert ended.value.code == ConfigError.exit_code
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "counts/s at most, expected 51 to 25600" in line and line.endswith("nothing was changed")


def test_a_bridge_that_coasts_is_measured_without_encoders(workshop_of, tmp_path, capsys):
    """Its speed is no line over the duty: the measured full speed is that of full duty."""
    path, facts = disc_kit(tmp_path, "l298n_enable", 170, no_encoders=True)
    workshop_of(path, OPEN_LOOP, "")
    with pytest.raises(SystemExit) as ended:
        main.main(["new", "rover", *map(str, facts)])
    assert not ended.value.code and "drives slow commands too fast" in capsys.readouterr().err
    assert models.load("rover").board["full_speed"] == pytest.approx(170, rel=0.1)


WORDS = "left,forward,rear_left,forward,right,forward,forward,yes"
"""What a user sees: the second output turns the rear left wheel, and the third one the right wheel."""
FOUR_M, FOUR_RAD, SIDE_SLIP = 0.01, 0.02, 0.05
_SKID = (_GEOMETRY[0], ("turn", "--count", 2))
_PROCEDURES = {"skid": _SKID, "mecanum": (*_SKID, ("sideways", "--count", 2, "--distance", 0.3))}


FOUR_WHEELS = [("skid", "python"), ("mecanum", "python"), ("mecanum", "avr")]
"""The last one computes for a quarter of a minute; the conformance tests drive four wheels on the image."""


@pytest.mark.timeout(300)
@pytest.mark.parametrize("kind, engine", FOUR_WHEELS if EXPLORE else FOUR_WHEELS[:2])
def test_four_wheels_with_hidden_errors_close_a_square(kind, engine, workshop_of, tmp_path):
    """Two motors swapped, one encoder reversed, one wheel 3 % larger, slip to the side: from `mrl new` on.

    On the simulated chip all wheels are alike, so that it closes without calibration.
    """
    true = four_wheels(kind)
    _, right, rear_left, _ = wiring.OUTPUTS
    swapped = {there: true.board[here] for here, there in zip(right + rear_left, rear_left + right)}
    path = tmp_path / "true.yaml"
    slips = f"kind: mecanum\n  side_slip: {SIDE_SLIP}"
    path.write_text(text_of(four_wheel_kit(kind, **swapped)).replace("kind: mecanum", slips))
    error = "rear_left=1.03" if engine == "python" else ""
    workshop = workshop_of(str(path), 1 | BITS["rear_right_encoder_reversed"], error, engine)
    base = ("--wheelbase", 120) if kind == "mecanum" else ()
    facts = (*FACTS, "--kind", kind, *base, "--wiring", "mega_four_wheels", "--answers", WORDS)
    out = workshop.mrl("new", "truck", *facts, "--no-flash", "--port", "tcp://kit:1", "--truth", "t", "--yes")
    assert "rear right encoder reversed" in out and "right_pwm_a on 8" in out
    path = str(tmp_path / "config" / "mrl-driver" / "robots" / "truck.yaml")
    for procedure in _PROCEDURES[kind] if error else ():
        workshop.mrl("calibrate", *procedure, "--robot", path, "--truth", "t", "--yes", "--eeprom")
    with workshop.robot("truck", period_ms=50) as robot:
        start = workshop.pose()
        manoeuvres.square(robot, SIDE_M, False, manoeuvres.Speeds())
        end = workshop.pose()
        stored = robot.parameters.read(*swapped)
    assert stored == swapped == {name: models.load("truck").board[name] for name in swapped}
    off_m, off_rad = math.dist(start[:2], end[:2]), abs(wrap_angle(end.yaw_rad - start.yaw_rad))
    assert off_m < FOUR_M and off_rad < FOUR_RAD
    if error and kind == "mecanum":
        assert models.load("truck").drive.side_slip == pytest.approx(SIDE_SLIP, abs=0.005)


@pytest.fixture
def truck(workshop_of, tmp_path):
    """A workshop with a base whose motors at the right and at the rear left are swapped, and the robot's file."""
    _, right, rear_left, _ = wiring.OUTPUTS
    board = four_wheels("skid").board
    swapped = {there: board[here] for here, there in zip(right + rear_left, rear_left + right)}
    for name, pins in (("true", swapped), ("truck", {})):
        (tmp_path / f"{name}.yaml").write_text(text_of(four_wheel_kit("skid", **pins)))
    made = workshop_of(str(tmp_path / "true.yaml"), 1, "")
    made.swapped, path = swapped, str(tmp_path / "truck.yaml")
    with made.robot(path) as robot:
        robot.parameters.save_model(40, models.load(path))
    return made, path


def calibrate_wiring(capsys, path):
    return calibrate(capsys, "wiring", "--robot", path, "--truth", "t", "--yes", "--answers", WORDS)


def test_a_file_that_cannot_take_the_pins_leaves_the_board_as_it_was(truck, monkeypatch, capsys):
    workshop, path = truck
    before = bytes(workshop.emulated.engine.eeprom)
    monkeypatch.setattr(calibration_files, "replace_file", Mock(side_effect=OutputError("no space left")))
    code, _, lines = calibrate_wiring(capsys, path)
    assert code == OutputError.exit_code and "no space left" in lines[-1]
    assert bytes(workshop.emulated.engine.eeprom) == before


def test_a_file_that_cannot_be_edited_is_named_before_anything_turns(truck, capsys):
    workshop, path = truck
    file = yaml.safe_load(pathlib.Path(path).read_text())
    pathlib.Path(path).write_text(yaml.safe_dump(file, default_flow_style=True))
    code, _, lines = calibrate_wiring(capsys, path)
    assert code == ConfigError.exit_code and "nothing was changed" in lines[-1]
    assert workshop.pose() == Pose(0.0, 0.0, 0.0)


def test_a_calibration_that_ended_between_file_and_board_is_done_by_the_next(truck, monkeypatch, capsys):
    workshop, path = truck
    with monkeypatch.context() as patched:
        patched.setattr(Parameters, "save", Mock(side_effect=KeyboardInterrupt))
        code, _, lines = calibrate_wiring(capsys, path)
    assert code == main.INTERRUPTED and any("run mrl calibrate wiring again" in line for line in lines)
    assert calibrate_wiring(capsys, path)[0] == 0
    workshop.emulated.engine.brown_out()
    with workshop.robot(path) as robot:
        stored = robot.parameters.read(*workshop.swapped)
    assert stored == workshop.swapped == {name: models.load(path).board[name] for name in stored}


def test_a_restart_before_the_pins_are_saved_does_not_save_those_of_before(truck, monkeypatch, capsys):
    """Neither the bridge, which the board had not stored yet."""
    workshop, path = truck
    with workshop.robot(path) as robot:
        bridge = robot.parameters.read("bridge")
        robot.parameters.replace({"bridge": 0})
    write = calibration_files.replace_file

    def write_while_it_restarts(*args):
        workshop.emulated.engine.brown_out()
        return write(*args)

    monkeypatch.setattr(calibration_files, "replace_file", write_while_it_restarts)
    assert calibrate_wiring(capsys, path)[0] == 0
    workshop.emulated.engine.brown_out()
    with workshop.robot(path) as robot:
        assert robot.parameters.read("bridge", *workshop.swapped) == {**bridge, **workshop.swapped}


@pytest.mark.parametrize("procedure", ["straight", "turn", "sideways", "umbmark", "sonar"])
def test_without_encoders_there_is_nothing_to_calibrate_with(procedure, workshop_of, tmp_path, capsys):
    path = without_encoders(tmp_path)
    workshop_of(path, OPEN_LOOP, "")
    code, _, lines = calibrate(capsys, procedure, "--robot", path, "--truth", "t", "--yes")
    assert code == ConfigError.exit_code
    assert "has no odometry, because its motors have no encoders" in lines[-1]


HIDDEN_MOUNT = {"roll_deg": 175.0, "pitch_deg": -4.0, "yaw_deg": 90.0}
"""How the emulated chip is mounted; its driver believes that it lies flat."""
LEVEL_DEG, YAW_DEG = 3.0, 8.0
"""The zero offset of the accelerometer puts roll and pitch off by up to 3 degrees."""
SCALE = 0.001  # The other axes, which have scales of their own, add a little where the chip is not level
TURNS, BEFORE_RAD, AFTER_RAD = 2, math.radians(5.0), math.radians(0.5)
SEED = 3


class Bench:
    """An emulated TraxBot with an IMU, a new one for each command, and the command line."""

    def __init__(self, capsys, path):
        self.options = {"imu": True, "imu_seed": SEED}
        self.emulated = self.driver = None
        self._capsys, self._path = capsys, str(path)

    @contextlib.contextmanager
    def robot(self, model, **options):
        self.emulated = factory.make(
            factory.Options(robot=self._path, footprint="none", error="slip=0.1", **self.options)
        )
        with SteppedDriver(self.emulated.engine, model, Options(**options)) as self.driver:
            yield self.driver

    def pose(self):
        return Pose(*self.emulated.plant.true_pose)

    def mrl(self, *args):
        return calibrate(self._capsys, "imu", *args)


@pytest.fixture
def bench(monkeypatch, tmp_path, capsys):
    lines = [f"  {name}: {value}" for name, value in HIDDEN_MOUNT.items()]
    text = pathlib.Path(models.path_of("traxbot")).read_text()
    (tmp_path / "emulated.yaml").write_text("\n".join([text, "imu:", *lines, ""]))
    made = Bench(capsys, tmp_path / "emulated.yaml")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setattr(
        calibrate_job, "connect", lambda job, **options: made.robot(job.target.model, **options)
    )
    monkeypatch.setattr(ground_truth, "truth_file", lambda path: made.pose)
    return made


def heading_error(bench, model):
    """Error of the driver's heading after some turns on slipping tracks [rad]."""
    with bench.robot(model) as robot:
        robot.wait(2.0)
        start = bench.pose()
        manoeuvres.turn(robot, math.tau * TURNS, manoeuvres.Speeds())
        return abs(wrap_angle(bench.pose().relative_to(start).yaw_rad - robot.pose.yaw_rad))


def test_a_chip_mounted_anyhow_gives_the_heading_after_its_calibration(bench):
    """Before it, the driver does not use the chip, which seems to lie upside down, and the tracks slip."""
    before_rad = heading_error(bench, "traxbot")
    code, out, lines = bench.mrl(
        "--truth", "t", "--turns", 1, "--count", 2, "--distance", 0.3, "--yes", "--json"
    )
    assert code == 0, lines
    found, true = models.load("traxbot-1.yaml").imu, ImuMount(**HIDDEN_MOUNT)
    assert found.gyro_scale_sd < 0.001
    assert found.gyro_scale == pytest.approx(1 / ImuErrors.drawn(SEED).gyro_scale[2], abs=SCALE)
    up = [math.degrees(a - b) for a, b in zip(axis_up(found), axis_up(true))]
    assert max(map(abs, up)) < LEVEL_DEG
    assert abs(math.remainder(found.yaw_deg - true.yaw_deg, 360)) < YAW_DEG
    assert json.loads(out)["mount_after"] == found._asdict()
    assert before_rad > BEFORE_RAD and heading_error(bench, "traxbot-1.yaml") < AFTER_RAD


def axis_up(mount):
    """The vertical in the axes of the chip."""
    return [mount.rotate(axis)[2] for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]


def test_a_board_without_a_chip_is_refused_before_anything_moves(bench):
    bench.options = {}
    code, _, lines = bench.mrl("--truth", "t", "--yes")
    assert code == 2 and "the board has found no IMU, expected an MPU-6050" in lines[-1]
    assert bench.pose() == Pose(0.0, 0.0, 0.0)


MEASURED = ImuMount(0.0, 0.0, 0.0, 179.25, -3.5, -90.1, 1.01234, 0.00045)


def test_a_measured_imu_is_read_back_as_it_was_written(tmp_path):
    """A second calibration replaces the numbers of the first; comments and all other numbers stay."""
    text = pathlib.Path(models.path_of("traxbot")).read_text()
    path = str(tmp_path / "robot.yaml")
    pathlib.Path(path).write_text(text)
    before = models.load(path)
    names = ("roll_deg", "pitch_deg", "yaw_deg", "gyro_scale", "gyro_scale_sd")
    for scale in (0.987, MEASURED.gyro_scale):
        mount = MEASURED._replace(gyro_scale=scale)
        values = {("imu", name): getattr(mount, name) for name in names}
        calibration_files.write_model(path, path, values, "mrl calibrate imu")
    assert models.load(path) == before._replace(imu=MEASURED)
    assert pathlib.Path(path).read_text().startswith(with_schema_line(text, models.SCHEMA).rstrip())
