"""The driver on a recording: its listeners get what those of the recorded driver got."""

import json
import math
import threading
import time
from itertools import takewhile
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mrl_driver.driver import Driver, Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError, LinkLost
from mrl_driver.geometry import Pose
from mrl_driver.protocol import REPLIES, Frame, Garbage, Stamp, encode_reply, encode_request
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording.decoded import FrameReader
from mrl_driver.recording.recorded_facts import (
    Joined,
    model_of,
    model_text,
    pose_of,
    session_of,
    session_text,
)
from mrl_driver.recording.recording import FROM_BOARD
from mrl_driver.robot import models
from mrl_driver.robot.heading import KnownBias
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import Lost, Reconnected, SensorRead, Status
from mrl_driver.session.handshake import Board
from sim_arduino.serve import factory
from tests.waiting import PATIENCE_S, drive_until, wait_until

from .test_own_stop import MOVE_MOTORS, close, stopped

POSE_ERROR, STAMP_ERROR_S = 1e-9, 0.02
LASTING = Options(command_timeout_s=None)
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
    for on in (robot.on_telemetry, robot.radio.on_text, robot.on_event):
        on(found.append)
    for kind in (Imu, Status, Board, SensorRead):
        robot.on(kind, found.append)
    return found


def shown(robot):
    """A list that gets the values that the callbacks of this driver can read."""
    found = []
    for listen_to in (robot.on_telemetry, lambda listener: robot.on(SensorRead, listener)):
        listen_to(lambda _: found.append((robot.ready, robot.twist, robot.ranges, robot.sensors)))
    return found


def drive(robot):
    """Turns, stops and new poses, in four seconds."""
    if not robot.model.drives:
        robot.wait(4.0)
        return
    for n, (linear_m_s, angular_rad_s) in enumerate([(0.2, 0.0), (0.1, 0.8), (0.0, 0.0), (-0.2, 0.3)]):
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
    heard, driven.shown = listen(driven), shown(driven)
    with driven:
        drive(driven)
    emulated.close()
    played = RecordedDriver(path)
    replayed, played.sent, played.heard, played.shown = listen(played), [], [], shown(played)
    played.on_sent(played.sent.append)
    played.on_heard(played.heard.append)
    played.play()
    return driven, heard, played, replayed


def test_listeners_get_the_same_to_the_last_bit(runs):
    _, heard, _, replayed = runs
    assert len(heard) > 20
    assert [repr(event) for event in replayed] == [repr(event) for event in heard]


def test_its_callbacks_read_the_same_speeds_ranges_and_sensors(runs):
    driven, _, played, _ = runs
    assert [repr(values) for values in played.shown] == [repr(values) for values in driven.shown]
    assert any(ready and (ranges or sensors) for ready, _, ranges, sensors in played.shown)


def test_its_state_at_the_end_is_the_same(runs):
    driven, _, played, _ = runs
    for name in (
        "pose",
        "twist",
        "ranges",
        "sensors",
        "ready",
        "imu",
        "imu_state",
        "status",
        "model",
        "board",
        "telemetry",
    ):
        assert repr(getattr(played, name)) == repr(getattr(driven, name)), name


@pytest.mark.parametrize("name", models.packaged())
def test_the_model_in_a_recording_is_the_robots(name):
    model = models.load(name)
    assert model_of(model_text(model)) == model


def test_nothing_can_be_sent(runs):
    played = runs[2]
    if played.model.drives:
        with pytest.raises(LinkLost, match="nothing is sent"):
            played.drive(0.1, 0.0)
    with pytest.raises(LinkLost, match="nothing is sent"):
        played.request(BY_NAME["robot_info"].code)


# -- other files


def lines_of(played):
    return Path(played.recording.path).read_text().splitlines(keepends=True)


def replay(path, lines=None, robot="auto"):
    """A replay of these lines, or of the file as it is: the driver, and what its listeners get."""
    if lines is not None:
        Path(path).write_text("".join(lines))
    played = RecordedDriver(str(path), robot)
    found = listen(played)
    played.play()
    return played, found


def of_kind(found, kind):
    return [event for event in found if isinstance(event, kind)]


def test_a_summary_ends_at_the_pose_of_the_replay(runs, tmp_path):
    """Also without the poses that were set after the first one."""
    lines = lines_of(runs[2])
    poses = [line for line in lines if " ! pose " in line]
    played, _ = replay(tmp_path / "drive.mrl", [line for line in lines if line not in poses[1:]])
    found = summarise(RecordedDriver(played.recording))
    assert found["robot"] == played.model.name
    if played.model.drives:
        assert tuple(found["pose"].values()) == pytest.approx(played.pose, abs=POSE_ERROR)
        assert found["imu"] == played.imu_state


def test_a_file_that_is_cut_at_its_start_goes_on_from_there(runs, tmp_path):
    _, _, played, _ = runs
    header, *lines = lines_of(played)
    rest = lines[len(lines) // 3 :]
    cut, found = replay(tmp_path / "cut.mrl", [header, *rest])
    assert cut.model == played.model and cut.pose == pytest.approx(played.pose, abs=POSE_ERROR)
    assert len(found) > 40


def test_one_that_begins_in_mid_run_has_the_pose_and_the_robot(serve, tmp_path):
    """It begins after the turn that is under way, which may still tell of a frame."""
    path, found = str(tmp_path / "later.mrl"), []
    with Driver(serve().path, options=LASTING) as robot:
        robot.reset_pose(Pose(1.0, 2.0, 0.5))
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 1.01)
        robot.recorder.start(path)
        robot.on_telemetry(found.append)
        drive_until(robot, 0.2, 0.0, lambda: robot.pose.x_m > 1.03)
    played, replayed = replay(path)
    assert tuple(summarise(RecordedDriver(played.recording))["pose"].values()) == pytest.approx(
        played.pose, abs=POSE_ERROR
    )
    assert (played.model, played.board.capabilities) == (robot.model, robot.board.capabilities)
    assert tuple(played.pose) == pytest.approx(tuple(robot.pose), abs=POSE_ERROR)
    replayed = {each.sequence: each for each in of_kind(replayed, Telemetry)}
    later = [each for each in found if each.arrival_s > found[0].arrival_s]
    assert later
    for telemetry in later:
        again = replayed[telemetry.sequence]
        assert tuple(again.pose) == pytest.approx(tuple(telemetry.pose), abs=POSE_ERROR)
        assert again.stamp_s == pytest.approx(telemetry.stamp_s, abs=STAMP_ERROR_S)


def test_a_lost_port_is_replayed_to_the_last_bit(cable, tmp_path, monkeypatch):
    """What is read while the line is raised does not reach the session."""

    def speed_up(link):
        link.write(encode_request(BY_NAME["robot_info"].code))
        return not wait_until(lambda: link.read(0.01))

    monkeypatch.setattr("mrl_driver.driver.link_source.speed_up", speed_up)
    path = str(tmp_path / "lost.mrl")
    robot = Driver(cable.path, options=Options(record=path, reconnect=True, fast=True))
    found = listen(robot)
    with robot:
        wait_until(lambda: len(of_kind(found, Telemetry)) > 5)
        cable.unplug()
        wait_until(lambda: of_kind(found, Lost))
        cable.plug()
        wait_until(lambda: of_kind(found, Reconnected))
        begin = len(found)
        wait_until(lambda: len(found) > begin + 10)
        robot.recorder.note_clock(1234.5)
    played, replayed = replay(path)
    assert [repr(event) for event in replayed] == [repr(event) for event in found]
    assert played.link.statistics.frames == robot.link.statistics.frames
    assert played.clock_ahead_s == 1234.5


def test_a_pose_that_is_set_while_a_frame_is_taken_is_replayed_in_order(serve, tmp_path, monkeypatch):
    """The reading thread has the time of the frame already, and another thread sets the pose before it."""
    path, clock = str(tmp_path / "pose.mrl"), time.monotonic_ns
    begun, armed, taken, posed = (threading.Event() for _ in range(4))

    def held():
        now = clock()
        if armed.is_set() and threading.current_thread().name == "mrl-driver":
            armed.clear()
            taken.set()
            assert posed.wait(PATIENCE_S)
        return now

    def arm(way, data):
        if way == FROM_BOARD and b"e" in data and begun.is_set() and not taken.is_set():
            armed.set()

    monkeypatch.setattr(time, "monotonic_ns", held)
    robot = Driver(serve().path, options=Options(record=path, tap=arm))
    found = listen(robot)
    with robot:
        begun.set()
        assert taken.wait(PATIENCE_S)
        robot.reset_pose(Pose(7.0, 0.0, 0.0))
        posed.set()
        wait_until(lambda: any(each.pose.x_m == 7.0 for each in of_kind(found, Telemetry)))
    _, replayed = replay(path)
    assert [repr(event) for event in replayed] == [repr(event) for event in found]


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """The lines of a short drive, and a file for others."""
    path = tmp_path_factory.mktemp("short") / "short.mrl"
    emulated = factory.make(factory.Options(robot="traxbot", imu=True))
    with SteppedDriver(emulated.engine, options=LASTING._replace(record=str(path))) as driven:
        driven.drive(0.2, 0.1)
        driven.wait(0.3)
        driven.reset_pose(Pose(1.0, 2.0, 0.3))
        driven.stop()
        driven.wait(0.3)
    emulated.close()
    return path.read_text().splitlines(keepends=True), path.with_name("other.mrl")


WORDS = (
    "session",
    "joined",
    "{}",
    "pose",
    "nan",
    "1e300",
    "stop",
    "lost",
    "clock",
    "slowed",
    "ended",
    "model",
    "opened",
)
DAMAGE = st.tuples(
    st.floats(0, 1), st.sampled_from([0, 1, 40]), st.sampled_from(WORDS), st.sampled_from(WORDS)
)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(DAMAGE, max_size=8))
def test_a_damaged_file_is_played_to_its_end(short, damages):
    """Lines are missing, and remarks are strange; the rest still counts."""
    lines, path = short
    header, *rest = lines
    for where, missing, word, other in damages:
        at = int(where * len(rest))
        time_s = rest[at].split(" ")[0] if at < len(rest) else "9"
        rest[at : at + missing] = [f"{time_s} ! {word} {other} 1 2 3\n"]
    played, found = replay(path, [header, *rest, "9.5 < @6,1,2e\n"])
    assert len(of_kind(found, Telemetry)) <= len(rest) + 1 and played.time_s == 9.5


def test_a_long_file_reports_how_far_it_is(short):
    """The shares add up to all of it, also if the file has less text than its lines seem to."""
    (header, *rest), path = short
    path.write_text("".join([header, *rest, *["9.5 < @6,1,2e\\n\n"] * 5000]))
    shares = []
    RecordedDriver(str(path)).play(shares.append)
    assert len(shares) > 2 and min(shares) > 0 and sum(shares) == pytest.approx(1.0)


@pytest.mark.parametrize("code", ["@29,", "@33,"])
def test_a_greeting_that_lacks_a_reply_ends_with_the_next_commands(short, code):
    """Not seconds later: the recorded driver drives, so it was greeted."""
    lines, path = short
    found = [at for at, line in enumerate(lines) if f"< {code}" in line]
    checked = next(at for at, line in enumerate(lines) if "! checked" in line)
    missing = next(at for at in found if at > checked)
    _, heard = replay(path, [*lines[:missing], *lines[missing + 1 :]])
    assert of_kind(heard, Telemetry)


def test_a_robot_that_is_given_replaces_the_recorded_one(short, tmp_path):
    lines, _ = short
    traxbot = models.load("traxbot")
    large = traxbot._replace(drive=traxbot.drive._replace(metres_per_count=1e-3))
    (as_recorded, _), (as_given, _) = (replay(tmp_path / "x.mrl", lines, robot) for robot in ("auto", large))
    assert as_given.model == large and as_given.pose.x_m > as_recorded.pose.x_m + 0.01


@pytest.mark.parametrize("name", models.names())
def test_a_recording_plays_as_that_of_any_robot(short, tmp_path, name):
    """Also of one whose base moves sideways, though the commands are those of one that does not."""
    lines, _ = short
    played, _ = replay(tmp_path / "x.mrl", lines, name)
    assert played.model.name == name and played.time_s > 0.5


def test_a_recording_of_an_unknown_robot_names_its_id(short, tmp_path):
    lines, _ = short
    greeting = [line for line in takewhile(lambda line: "checked" not in line, lines) if " ! " not in line]
    robot = ["#mrl-recording 1 {}\n", *(line.replace(",2,1e", ",2,999e") for line in greeting[1:])]
    with pytest.raises(ConfigError, match="no packaged model lists robot id 999; give its file with --robot"):
        replay(tmp_path / "x.mrl", robot)


def test_an_empty_recording_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="holds nothing"):
        replay(tmp_path / "x.mrl", ["#mrl-recording 1 {}\n"])


def test_a_new_difference_of_the_clocks_holds_for_the_frame_that_noticed_it(short, tmp_path):
    """Its remark comes behind the bytes.  Before the first one, the first one holds."""
    lines, _ = short
    at = [n for n, line in enumerate(lines) if " < " in line and line.endswith("e\\r\\n\n")]
    before, after = at[-20], at[-10]
    for n, ahead in ((after, "7.5"), (before, "5.25")):
        lines = [*lines[: n + 1], f"{lines[n].split(' ')[0]} ! clock {ahead}\n", *lines[n + 1 :]]
    changed_s = float(lines[after + 1].split(" ")[0])
    path, seen = tmp_path / "clock.mrl", []
    path.write_text("".join(lines))
    played = RecordedDriver(str(path))
    played.on_telemetry(lambda telemetry: seen.append((telemetry.arrival_s, played.clock_ahead_s)))
    played.play()
    assert {ahead for time_s, ahead in seen if time_s < changed_s} == {5.25}
    assert {ahead for time_s, ahead in seen if time_s >= changed_s} == {7.5}


@pytest.mark.parametrize("size", [1, 3, 7, 46, 1000])
def test_each_frame_has_its_bytes_however_they_arrive(size):
    frames = [b"@5,2500,172,1180,2,1e", b"@30,0,1,1,1,0,0e"]
    data, reader = b"the\r\n" + b"\r\n".join(frames) + b"\r\n@6,1@30,0,1,1,1,0,0e", FrameReader(REPLIES)
    pieces = [data[at : at + size] for at in range(0, len(data), size)]
    found = [each for piece in pieces for each in reader.read(piece, False, False)]
    assert [raw for event, raw in found if isinstance(event, Frame)] == [*frames, frames[1]]
    assert [raw for event, raw in found if isinstance(event, Garbage)] == [b"the", b"@6,1"]


@pytest.mark.parametrize(
    "turned, kinds", [(True, [Frame, Frame, Garbage]), (False, [Garbage, Garbage, Garbage])]
)
def test_frames_of_the_other_form_are_read_where_the_form_may_have_turned(turned, kinds):
    """And after the first one they are the rule; other garbage stays what it is."""
    checked, plain = encode_reply(7, 30, 40, 50, checked=True), encode_reply(7, 30, 40, 50)
    reader = FrameReader(REPLIES)
    found = reader.read(checked + b"\r\n", False, turned) + reader.read(
        checked + b"\r\n" + b"x\r\n", None, False
    )
    assert [type(event) for event, _ in found] == kinds
    if turned:
        assert [raw for _, raw in reader.read(plain, None, True)] == [plain.strip()]


@pytest.mark.parametrize(
    "checked, stamp, whole", [(True, Stamp(7, 1234), True), (False, None, True), (True, None, False)]
)
@pytest.mark.parametrize("bias", [None, KnownBias(0.01, 1e-6, 2e-7)])
def test_a_session_is_read_as_it_was_written(checked, stamp, whole, bias):
    """A frame without a stamp came before the checksums: it says nothing about what follows."""
    last = Frame(BY_NAME["read_encoders_and_sonars"].code, (1, 2, 30, 40, 50), stamp)
    session = SimpleNamespace(checked=checked, last_frame=last, stream_code=last.code)
    board = Board(1, 2, 1.72, 12.0, 25.0, 2, frozenset({"check", "imu"}))
    expected = Joined(board, last.code, checked, 3.5, last if whole else None, bias)
    assert session_of(session_text(session, board, 3.5, bias)) == expected


SAVED = {"stream": 7, "checked": False, "stamp_s": 3.5, "frame": "@7,30,40,50e", "bias": None}
SAVED["board"] = Board(1, 2, 1.72, 12.0, 25.0, 2, ["imu"])._asdict()
NUMBERS, WHOLE = ("battery_v", "temperature_c", "motor_board_version"), ("robot_id", "version", "protocol")
GOOD = {**dict.fromkeys(WHOLE, (0, 32767)), **dict.fromkeys(NUMBERS, (math.nan, 0)), "capabilities": ([],)}
BAD = {
    **dict.fromkeys((*WHOLE, "stream"), (32768, -1, 1.0)),
    **dict.fromkeys(NUMBERS, (math.inf, "x")),
    **{"capabilities": ([1], 7), "checked": (0, None), "stamp_s": ("x",), "board": (1,)},
}


def joined(**changes):
    board = {name: changes.pop(name, value) for name, value in SAVED["board"].items()}
    return session_of(json.dumps({**SAVED, "board": board, **changes}))


@pytest.mark.parametrize("name", BAD)
def test_a_session_with_a_damaged_fact_is_not_joined(name):
    assert [joined(**{name: value}) for value in BAD[name]] == [None] * len(BAD[name])
    assert all(joined(**{name: value}) for value in GOOD.get(name, ()))


@pytest.mark.parametrize("stamp_s, whole", [(0, True), (math.nan, False), (math.inf, False)])
def test_a_last_frame_without_a_time_is_not_used(stamp_s, whole):
    assert joined(stamp_s=stamp_s).last == (Frame(7, (30, 40, 50)) if whole else None)
    assert joined(stream=32767).last is None, "it is not the frame of the stream"
    assert joined(frame="\u00e9").last is None


@pytest.mark.parametrize("text", ["[]", "7", "{}", "[" * 100000, "x"], ids=len)
def test_what_is_no_session_is_not_joined(text):
    assert session_of(text) is None and model_of(text) is None


@pytest.mark.parametrize("bias", [[1.0, 0.0, 0.0], [-1, 1, 1.0]])
def test_a_bias_that_is_damaged_is_not_used(bias):
    assert joined(bias=bias).bias == tuple(bias)
    negative, large = ([0.0, -0.1, 0.0], [0.0, 0.0, -0.1]), ([1.5, 0.0, 0.0], [0.0, 0.0, 1.5])
    for damaged in (
        *negative,
        *large,
        [],
        [*bias, 0.1],
        bias[:2],
        "abc",
        [True, 0.0, 0.0],
        [math.nan, 0.0, 0.0],
    ):
        assert joined(bias=damaged).bias is None


def test_a_pose_is_read_with_its_covariance():
    text = b"1 2 0.5 3 0 0 4 0 5"
    assert pose_of(text) == (Pose(1.0, 2.0, 0.5), (3.0, 0.0, 0.0, 4.0, 0.0, 5.0))
    for damaged in (text[:-2], text + b" 6", b"x", text.replace(b"2", b"nan"), text.replace(b"3", b"-3")):
        assert pose_of(damaged) is None


@pytest.mark.parametrize("far", ["1.1e8 0 0", "0 -1.1e8 0", "0 0 3.2", "0 0 -3.2"])
def test_a_pose_that_no_driver_sets_is_not_read(far):
    """Charts and messages have no numbers for it."""
    assert pose_of(f"{far} 1 0 0 1 0 1".encode()) is None
    assert pose_of(b"1e8 -1e8 3.14 1 0 0 1 0 1") is not None


@pytest.mark.parametrize("stamp_s", [1e308, -1e308, 999.0])
def test_a_session_with_a_damaged_time_has_the_stamps_of_now(tmp_path, stamp_s):
    """Messages have no numbers for times as far away as that."""
    code = BY_NAME["read_encoders_and_sonars"].code
    frame = encode_reply(code, 1, 2, 30, 40, 50).decode().strip()
    facts = {**SAVED, "stream": code, "frame": frame, "stamp_s": stamp_s}
    lines = ["#mrl-recording 1 {}\n", "0.1 ! opened x\n", f"0.1 ! session joined {json.dumps(facts)}\n"]
    _, found = replay(tmp_path / "x.mrl", [*lines, f"0.2 < {frame}\\r\\n\n"])
    assert [each.stamp_s for each in of_kind(found, Telemetry)] == [0.2]


def test_a_request_that_turned_motors_plays_without_a_stop(tmp_path):
    """The replay does not know that the request turns the wheels, and has nobody to stop."""
    path = str(tmp_path / "requested.mrl")
    robot = stopped(20, record=path)
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.wait(0.5)
    close(robot)
    played = RecordedDriver(path)
    played.play()
    assert played.link.statistics.uncommanded_motions == 0
