"""The driver on a recording: its listeners get what those of the recorded driver got."""

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import LinkLost
from mrl_driver.geometry import Pose
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.serve import factory

NOISE = ("flip:rate=0.0005", "loss:rate=0.0005,burst=3", "delay:jitter=0.016")
BOARDS = {
    "checked": dict(robot="traxbot", imu=True, imu_seed=1),
    "noise": dict(robot="stingbot", faults=NOISE),
    "resets": dict(robot="traxbot", imu=True, faults=("reset:at=1.5", "reset:at=3.5", *NOISE)),
    "silences": dict(robot="traxbot", faults=("stall:at=1,lasts=0.4", "freeze:at=2.5,lasts=1")),
    "2013": dict(robot="traxbot", profile="2013-august", faults=("stall:at=1,lasts=0.5", *NOISE)),
    "omni": dict(robot="omni"),
    "blocked": dict(robot="duo", faults=("encoder_open:at=1",)),
    "without motors": dict(robot="pioneer", environment=True),
}


def listen(robot):
    """A list that gets all that the listeners of this driver get."""
    found = []
    for on in (
        *(robot.on_telemetry, robot.on_imu, robot.on_status, robot.on_battery, robot.on_sensor),
        *(robot.on_text, robot.on_event),
    ):
        on(found.append)
    return found


def drive(robot):
    """Turns, stops and a new pose, in five seconds."""
    if not robot.model.drives:
        robot.wait(5.0)
        return
    for n, (linear_m_s, angular_rad_s) in enumerate(
        [(0.2, 0.0), (0.1, 0.8), (0.0, -0.8), (0.0, 0.0), (-0.2, 0.3)]
    ):
        for _ in range(8):
            robot.drive(linear_m_s, angular_rad_s)
            robot.wait(0.1)
        robot.reset_pose(Pose(n / 3, -n / 7, n / 11))
        robot.stop()
        robot.wait(0.2)


@pytest.fixture(scope="module", params=BOARDS)
def runs(request, tmp_path_factory):
    """A drive in simulated time and its replay: both drivers, and what their listeners got."""
    path = str(tmp_path_factory.mktemp("drive") / "drive.mrl")
    emulated = factory.make(factory.Options(world="square", seed=3, **BOARDS[request.param]))
    driven = SteppedDriver(emulated.engine, options=Options(record=path))
    heard = listen(driven)
    with driven:
        drive(driven)
    emulated.close()
    played = RecordedDriver(path)
    replayed = listen(played)
    played.play()
    return driven, heard, played, replayed


def test_listeners_get_the_same_to_the_last_bit(runs):
    _, heard, _, replayed = runs
    assert len(heard) > 20
    assert [repr(event) for event in replayed] == [repr(event) for event in heard]


def test_its_state_at_the_end_is_the_same(runs):
    driven, _, played, _ = runs
    for name in ("pose", "ranges", "battery_v", "imu", "imu_state", "status", "model", "board", "telemetry"):
        assert repr(getattr(played, name)) == repr(getattr(driven, name)), name


def test_frames_are_told_with_their_bytes(runs):
    _, _, played, _ = runs
    played, sent, heard = RecordedDriver(played.recording.path), [], []
    played.on_sent(sent.append)
    played.on_heard(heard.append)
    played.play()
    assert sum(isinstance(each.event, Frame) for each in heard) == played.statistics.frames
    assert all(each.data.endswith(b"e") for each in heard + sent if isinstance(each.event, Frame))
    assert Frame(BY_NAME["stop"].code, ()) in {each.event for each in sent}


def test_nothing_can_be_sent(runs):
    played = runs[2]
    if played.model.drives:
        with pytest.raises(LinkLost, match="nothing is sent"):
            played.drive(0.1, 0.0)
    with pytest.raises(LinkLost, match="nothing is sent"):
        played.request(BY_NAME["robot_info"].code)
