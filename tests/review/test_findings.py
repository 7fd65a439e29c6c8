"""What went wrong comes first: twenty drives with one fault each, and good ones as the control.

`python -m tests.review.holdout` drives many more, with other seeds, robots, worlds and faults.
"""

import math

import numpy as np
import pytest

from mrl_driver.apps.review.drive_data import Column, read
from mrl_driver.apps.review.findings import find
from mrl_driver.apps.review.findings.evidence import SETTLING_S, interruptions
from mrl_driver.driver import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.recording.recording import Recorder
from sim_arduino.serve import factory
from tests.conftest import EXPLORE

from .drives import Drive, record
from .faulty_drives import faulty, good

FAULTY = faulty()


def findings_of(drive, tmp_path):
    path = str(tmp_path / "drive.mrl")
    record(drive, path)
    return find(read(RecordedDriver(path)))


@pytest.mark.parametrize("drive", FAULTY, ids=[each.name.replace(" ", "-") for each in FAULTY])
def test_the_fault_of_a_drive_comes_first(drive, tmp_path):
    found = findings_of(drive, tmp_path)
    assert [each.kind for each in found][:1] and found[0].kind in drive.expected
    assert found[0].data and 0.0 <= found[0].time_s <= drive.duration_s + 5.0


@pytest.mark.parametrize("seed", range(1, 21 if EXPLORE else 9))
def test_a_good_drive_has_no_finding(seed, tmp_path):
    assert findings_of(good(seed), tmp_path) == []


@pytest.mark.parametrize(
    "drive, kind",
    [
        (Drive("bytes lost both ways", board={"faults": ("loss:rate=0.005",)}, duration_s=13.0), "bad_cable"),
        (next(each for each in FAULTY if each.name == "dead encoder"), "encoder_dead"),
    ],
    ids=["lost requests", "dead encoder"],
)
def test_what_follows_from_a_fault_is_not_a_finding_of_its_own(drive, kind, tmp_path):
    assert [each.kind for each in findings_of(drive, tmp_path)] == [kind]


@pytest.mark.parametrize(
    "fault, kind, duration_s, proof",
    [
        ("stall:at=2.5,lasts=0.7", "line_stalled", 5.0, b""),
        ("stall:at=2.1,lasts=0.2,every=1.37", "line_stalled", 8.0, b""),
        ("reset:at=4", "board_restart", 8.0, b"@30,0,0,2,"),
    ],
)
def test_a_line_that_holds_data_back_is_not_a_busy_computer(fault, kind, duration_s, proof, tmp_path):
    """The frame that proves a restart has its cause."""
    drive = Drive("stall", board={"faults": (fault,)}, duration_s=duration_s, seed=3)
    found = findings_of(drive, tmp_path)[0]
    assert found.kind == kind and found.data.startswith(proof)


@pytest.mark.parametrize(
    "fault, profile",
    [
        ("loss:rate=1,at=4,direction=to_host", "current"),
        ("loss:rate=1,at=4,direction=to_host", "2013-august"),
        ("freeze:at=4,lasts=100", "current"),
    ],
)
def test_a_board_that_stays_silent_to_the_end_is_a_finding_with_its_last_frame(fault, profile, tmp_path):
    drive = Drive("silent", board={"faults": (fault,), "profile": profile}, duration_s=6.0, seed=3)
    (found,) = findings_of(drive, tmp_path)
    assert found.kind == "board_silent" and found.time_s == pytest.approx(4.0, abs=0.2) and found.data


def test_a_program_that_ended_because_its_port_went_away_has_lost_its_link(tmp_path):
    path = tmp_path / "drive.mrl"
    record(Drive("good", duration_s=3.0), str(path))
    with path.open("a") as file:
        file.write("9.0 ! ended LinkLost: the port went away\n")
    assert [each.kind for each in find(read(RecordedDriver(str(path))))] == ["link_lost"]


def test_a_robot_whose_front_sonar_touches_a_wall_pushes_it(tmp_path):
    """Its sonar shows the shortest range then."""
    path = str(tmp_path / "drive.mrl")
    board = factory.make(factory.Options(robot="traxbot", world="room")).board
    with SteppedDriver(board, "traxbot", Options(record=path)) as robot:
        for _ in range(220):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
    assert [each.kind for each in find(read(RecordedDriver(path)))] == ["pushing"]


@pytest.fixture(scope="module")
def lines(tmp_path_factory):
    """The lines of a good drive that moves at 3.5 s."""
    path = tmp_path_factory.mktemp("good") / "drive.mrl"
    record(good(3), str(path))
    return path.read_text().splitlines(keepends=True)


def reviewed(path, lines):
    path.write_text("".join(lines))
    drive = read(RecordedDriver(str(path)))
    return drive, find(drive)


def until(lines, end_s):
    return [line for line in lines[1:] if float(line.split(" ")[0]) < end_s]


def test_a_time_in_which_the_disk_was_full_is_not_a_fault_of_the_line(lines, tmp_path):
    before = until(lines, 3.5)
    behind = lines[len(until(lines, 5.0)) + 1 :]
    end_s, since_s = behind[0].split(" ")[0], before[-1].split(" ")[0]
    lack = (
        f'{end_s} ! file_lacks {{"lines": 99, "since_s": {since_s}, "reason": "No space left on device"}}\n'
    )
    silence = f"{end_s} < \n"  # the driver that plays it notices it
    drive, (found,) = reviewed(tmp_path / "x.mrl", [lines[0], *before, lack, silence, *behind])
    assert found.kind == "recording_damaged" and "99 lines" in found.text
    assert "No space left on device" in found.text and found.time_s == float(since_s)
    assert "no_telemetry" not in [stop.reason for stop in drive.stops]
    assert (float(since_s) - SETTLING_S, float(end_s) + SETTLING_S) in interruptions(drive)


def test_a_recording_that_breaks_off_while_the_robot_drives_is_a_finding(lines, tmp_path):
    drive, (found,) = reviewed(tmp_path / "x.mrl", [lines[0], *until(lines, 3.5)])
    assert found.kind == "recording_breaks_off" and found.data
    assert drive.breaks_off and found.time_s == pytest.approx(3.5, abs=0.2)


def test_a_recording_that_is_still_written_does_not_break_off(tmp_path):
    path = str(tmp_path / "x.mrl")
    recorder = Recorder(path)
    try:
        assert not RecordedDriver(path).breaks_off
    finally:
        recorder.close()


@pytest.mark.parametrize(
    "header, end_s, end",
    [
        ("marks_end", 3.5, "3.5 ! file_ends\n"),
        ("marks_end", 0.9, ""),
        ("of an older version", 3.5, ""),
    ],
    ids=["ended while it drives", "killed while it stands", "no marks"],
)
def test_a_recording_that_ends_otherwise_has_no_finding(lines, tmp_path, header, end_s, end):
    first = lines[0].replace("marks_end", header)
    assert reviewed(tmp_path / "x.mrl", [first, *until(lines, end_s), end])[1] == []


@pytest.fixture(scope="module")
def turning(tmp_path_factory):
    """A good drive whose poses are replaced: the robot turns round once, in front of changing walls."""
    path = str(tmp_path_factory.mktemp("turning") / "drive.mrl")
    record(good(3), path)
    drive = read(RecordedDriver(path))
    poses = drive.poses.values.copy()
    poses[:, 2] = np.linspace(0.0, 2 * math.pi, len(poses))
    return drive._replace(poses=drive.poses._replace(values=poses))


def seen(drive, **ranges_m):
    """Kinds of the findings, if some sonars always show these ranges and the others ever larger ones."""
    ranges = {
        name: Column(column.time_s, np.full(len(column.time_s), ranges_m[name]))
        if name in ranges_m
        else Column(column.time_s, np.linspace(0.5, 3.0, len(column.time_s)))
        for name, column in drive.ranges.items()
    }
    return [each.kind for each in find(drive._replace(ranges=ranges))]


@pytest.mark.parametrize(
    "ranges_m, kinds",
    [
        ({}, []),
        ({"left": 1.2}, ["sonar_stuck"]),
        ({"front": 1.9, "left": 1.2, "right": 2.0}, ["pushing"]),
        ({"right": math.inf}, ["sonar_deaf"]),
        ({"front": math.inf, "left": math.inf, "right": math.inf}, []),
    ],
)
def test_a_sonar_is_judged_by_the_others(turning, ranges_m, kinds):
    """Stuck, if it shows the same while the robot turns; deaf, if it sees nothing where the others see walls."""
    assert seen(turning, **ranges_m) == kinds


def test_a_sonar_that_sees_less_far_than_the_others_is_not_deaf(turning):
    """They see walls at 0.5 to 3 m."""
    sonars = dict(turning.model.sonars)
    sonars["right"] = sonars["right"]._replace(type="GP2Y0A21")
    assert seen(turning._replace(model=turning.model._replace(sonars=sonars)), right=math.inf) == []


def test_infrared_ranges_do_not_tell_the_size_of_the_wheels(tmp_path):
    """They are distances along the axis, not to the nearest point of a wall."""
    path = str(tmp_path / "drive.mrl")
    record(next(each for each in FAULTY if each.name == "smaller wheels"), path)
    drive = read(RecordedDriver(path))
    sonars = {name: mount._replace(type="GP2Y0A02") for name, mount in drive.model.sonars.items()}
    kinds = [each.kind for each in find(drive._replace(model=drive.model._replace(sonars=sonars)))]
    assert "wheel_size" not in kinds


def test_junk_from_before_the_greeting_is_not_a_bad_cable(turning):
    junk = [(0.001 * i, "<", "noise", b"\xff") for i in range(9)]
    assert [each.kind for each in find(turning._replace(garbage=junk))] == []
    assert [
        each.kind for each in find(turning._replace(garbage=[(4.0 + i / 9, *junk[i][1:]) for i in range(9)]))
    ] == ["bad_cable"]


def test_a_paused_computer_is_found_in_files_that_do_not_name_it(tmp_path):
    """Older recordings lack the reasons of stops.  A stop that both sides report is there once."""
    path = str(tmp_path / "drive.mrl")
    record(next(each for each in FAULTY if each.name == "late host"), path)
    paused = read(RecordedDriver(path))
    stops = paused.stops
    assert not [a for a, b in zip(stops, stops[1:]) if a.reason == b.reason and b.time_s - a.time_s < 0.5]
    others = [stop for stop in stops if stop.reason != "host_paused"]
    assert len(others) < len(stops) and find(paused._replace(stops=others))[0].kind == "late_host"
