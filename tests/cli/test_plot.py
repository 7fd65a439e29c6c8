"""`mrl plot`: recordings to columns and pictures; on a full disk what was there stays, with exit code 15."""

import json
import math
import os
import stat

import pytest

from mrl_driver import figures
from mrl_driver.apps.review import drive_data
from mrl_driver.driver import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import OutputError
from mrl_driver.files import replace_file
from mrl_driver.protocol import Stamp, encode_reply, encode_request
from mrl_driver.protocol.table import CAPABILITIES
from mrl_driver.recording.recording import Recording
from sim_arduino.serve import factory

from .run import fails, mrl
from .terminal import Terminal, on_a_full_disk

METRES_PER_COUNT = 0.000087512033  # TraxBot's


def entry(time_s, way, data):
    return f"{time_s:.6f} {way} {data.decode().strip()}\n"


def greeting(robot_id, *names):
    """What a board with these capabilities answers when the driver greets it."""
    info, protocol = (5, 2500, 172, 1200, 2, robot_id), (29, 2, bits("check", "watchdog", *names))
    yield from (encode_reply(*info), encode_reply(*protocol), encode_reply(32, 1, checked=True))
    for reply in (info, protocol, (33, 250), (30, 0, 0, 1, 0, 0, 0)):
        yield encode_reply(*reply, checked=True)


def bits(*names):
    return sum(1 << i for i, (name, _) in enumerate(CAPABILITIES) if name in names)


@pytest.fixture
def recorded(tmp_path):
    """A tenth of a second at rest, half a metre straight ahead in 2 s, a torn line, and a second answer."""
    lines = ['#mrl-recording 1 {"port": "x", "started": "2026-03-01T12:00:00+00:00"}\n']
    lines += [entry(0.001 * i, "<", frame) for i, frame in enumerate(greeting(1, "sonars"))]
    lines.insert(4, "0.002000 ! checked\n")
    lines.append(entry(0.01, ">", encode_request(11, 250, 0, checked=True)))
    for i in range(106):
        count = round(max(0, i - 5) * 0.005 / METRES_PER_COUNT)
        frame = encode_reply(8, count, count, 100, 200, 645, stamp=Stamp(i, i * 312), checked=True)
        lines.append(entry(0.02 + i * 0.02, "<", frame))
    lines.append(entry(2.13, "<", encode_reply(5, 2500, 172, 1200, 2, 1, checked=True)))
    lines += [entry(2.2, ">", encode_request(13)), "what is this\n"]
    path = tmp_path / "drive.mrl"
    path.write_text("".join(lines))
    return path


def read(recorded, robot="auto"):
    return drive_data.read(
        RecordedDriver(recorded if isinstance(recorded, Recording) else str(recorded), robot)
    )


def columns(recorded):
    """The poses, ranges and voltages of a recording."""
    found = read(recorded)
    columns = found.poses, found.battery, *found.ranges.values()
    return [each.tolist() for column in columns for each in column]


def test_columns_of_a_recording(recorded):
    found = read(recorded)
    assert found.poses.time_s[-1] == 2.12 and tuple(found.poses.values[-1]) == pytest.approx(
        (0.5, 0, 0), abs=1e-4
    )
    assert found.speeds.values[-1][0] == pytest.approx(0.25, abs=0.01)
    assert found.commands.time_s.tolist() == [0.01, 2.2]
    assert found.commands.values.tolist() == [[0.25, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert found.ranges["front"].values[0] == 1.0 and math.isinf(found.ranges["right"].values[0])
    assert found.battery.values[0][0] == 12.0 and (found.model.name, found.robot_id) == ("traxbot", 1)


def record(path, *greeting):
    """A recording of a board that greets with these replies, and then sends counts and three more values."""
    frames = [*greeting, *(encode_reply(8, i, i, 100, 200, 645) for i in range(9))]
    lines = [entry(0.01 * i, "<", frame) for i, frame in enumerate(frames)]
    path.write_text("#mrl-recording 1 {}\n" + "".join(lines))
    return Recording(str(path))


def test_values_of_a_board_that_says_it_has_no_sonars_are_not_ranges(tmp_path):
    greeting = encode_reply(5, 2500, 172, 1200, 2, 1), encode_reply(29, 2, bits("environment", "period"))
    found = read(record(tmp_path / "a.mrl", *greeting))
    assert found.ranges == {} and len(found.poses.time_s)


@pytest.mark.parametrize(
    "greeting", [[], [encode_reply(5, 2500, 172, 1200, 1, 1)]], ids=["without-greeting", "2013"]
)
def test_ranges_that_may_be_other_values_are_drawn_with_a_warning(tmp_path, greeting):
    record(tmp_path / "a.mrl", *greeting)
    done = mrl("plot", tmp_path / "a.mrl", "--robot", "traxbot")
    assert done.stderr.count("\n") == 1
    assert "a.mrl does not say whether the board has sonars" in done.stderr
    assert "build: environment" in done.stderr


def test_a_picture_beside_the_recording(recorded):
    done = mrl("plot", recorded)
    picture = recorded.with_suffix(".png")
    assert done.stdout == f"{picture}\n" and picture.read_bytes().startswith(b"\x89PNG")
    assert ":119: skipped: time is b'what'" in done.stderr


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (["/nowhere/drive.mrl"], "folder /nowhere cannot be written"),
        (["/nowhere/drive.mrl", "-o", "x.png"], "cannot read '/nowhere/drive.mrl'"),
        ([__file__, "-o", "x.png"], "not a recording"),
        (["drive.mrl", "-o", "x.jpeg"], "expected a file that ends in .png, .pdf, .svg"),
        (["drive.mrl", "-o", "x.png", "--robot", "nix"], "robot 'nix' is unknown"),
    ],
)
def test_what_cannot_be_drawn(args, words, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert words in fails(2, "plot", *args)


def test_a_port_is_not_read_as_a_recording(serve):
    """It would wait for bytes, and take them from the program that drives the robot."""
    assert "is not a plain file; give a recording" in fails(2, "plot", serve().path, "-o", "p.png")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two seconds ahead in simulated time, and a stop."""
    path = tmp_path_factory.mktemp("drive") / "drive.mrl"
    emulated = factory.make(factory.Options(robot="traxbot", seed=1))
    with SteppedDriver(emulated.engine, options=Options(record=str(path))) as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        robot.stop()
        robot.wait(0.3)
    emulated.close()
    return path


def test_programs_get_findings_and_stops(recording, tmp_path):
    page = tmp_path / "page.html"
    done = mrl("review", recording, "-o", page, "--json")
    found = json.loads(done.stdout)
    assert (found["page"], found["robot"], found["findings"]) == (str(page), "traxbot", [])
    stop = found["stops"][0]
    assert (stop["reason"], stop["direction"], stop["data"]) == ("user", ">", "@13e")
    assert stop["time_s"] == pytest.approx(2.0, abs=0.2) and page.exists()


def test_the_page_never_replaces_the_recording(recording):
    before = recording.read_bytes()
    assert "would replace the recording" in fails(2, "review", recording, "-o", recording)
    assert recording.read_bytes() == before


FULL = OutputError.exit_code


@pytest.mark.parametrize(
    "command",
    [
        ("record", "--seconds", "1.2", "/dev/full"),
        ("monitor", "--seconds", "1.2", "--record", "/dev/full"),
        ("drive", "--linear", "0.1", "--for", "0.6", "--record", "/dev/full"),
    ],
    ids=lambda words: words[0],
)
def test_a_recording_that_lacks_lines_has_its_exit_code(serve, command):
    done = mrl(*command, "--port", serve().path)
    assert done.returncode == FULL
    assert "mrl: /dev/full lacks " in done.stderr and "No space left on device" in done.stderr


def test_the_live_view_says_that_the_recording_is_incomplete(serve):
    terminal = Terminal("record", "--port", serve().path, "/dev/full")
    try:
        terminal.answer("INCOMPLETE", "q")
        terminal.answer("No space left on device", "q")
    finally:
        code = terminal.end()
    assert code == FULL


def test_an_old_picture_stays(recorded):  # noqa: F811
    picture = recorded.with_suffix(".png")
    picture.write_bytes(b"old")
    figures.figure(2, 2)  # the first on a machine looks for fonts, which takes long and is kept in a file
    done = on_a_full_disk(4096, "mrl_driver", "plot", recorded)
    assert done.returncode == FULL and done.stderr.count("\n") == 1, done.stderr
    assert f"{picture} cannot be written: File too large; nothing was changed" in done.stderr
    assert picture.read_bytes() == b"old" and not list(recorded.parent.glob(".mrl-*"))


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.yaml").write_text("old")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    replace_file(str(tmp_path / "link.yaml"), "new")
    assert (tmp_path / "link.yaml").is_symlink() and (tmp_path / "real.yaml").read_text() == "new"


def test_no_other_file_is_written_on_the_way(tmp_path):
    """In a folder such as /tmp, another user may have guessed a name and made a link of it."""
    kept = tmp_path / "kept"
    kept.write_text("kept")
    (tmp_path / f"robot.yaml.{os.getpid()}.new").symlink_to(kept)
    replace_file(str(tmp_path / "robot.yaml"), "new")
    assert kept.read_text() == "kept"


def test_permissions_stay(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("old")
    path.chmod(0o640)
    replace_file(str(path), "new")
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_failure_leaves_the_old_file_alone(tmp_path):
    folder = tmp_path / "robot.yaml"
    folder.mkdir()
    with pytest.raises(OutputError, match="nothing was changed"):
        replace_file(str(folder), "new")
    assert os.listdir(tmp_path) == ["robot.yaml"]


def test_what_is_not_a_plain_file_is_never_replaced(tmp_path):
    """As root, a rename would replace even a device such as /dev/null."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(OutputError, match="not a plain file"):
        replace_file(str(path), "new")
    assert stat.S_ISFIFO(path.stat().st_mode) and os.listdir(tmp_path) == ["pipe"]
