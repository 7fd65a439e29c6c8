"""`mrl replay`: what a recording holds, and a recording as a board."""

import math
import os
import pathlib
import subprocess
import sys
import threading
import time

import pytest

from mrl_driver.driver import Driver
from mrl_driver.driver.options import Options
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.protocol import Stamp, encode_reply, encode_request
from mrl_driver.recording.recording import FROM_BOARD, Recording
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry
from sim_arduino.replay import playback
from sim_arduino.serve.pty import PtyPort
from tests.driver.emulator import Emulator
from tests.waiting import PATIENCE_S

from .simulator import Client

HEADER = '#mrl-recording 1 {"port": "/dev/ttyX", "started": "2026-01-01T00:00:00+00:00"}\n0.0 ! opened x\n'
INFO = "@5,2500,172,1360,2,1e\\r\\n"
JOINED = (
    '! session joined {"board": {"robot_id": 1, "version": 2, "protocol": 2, "motor_board_version": 2.5, '
    '"battery_v": 13.6, "temperature_c": 25.0, "capabilities": ["check", "sonars"]}, "stream": 8, "checked": true, '
    '"stamp_s": 0, "frame": ""}'
)
MRL = os.path.join(os.path.dirname(sys.executable), "mrl")
"""As installed, for sub-commands are found through the installation."""
WAY_M, YAW_RAD = 1e-6, 1e-6


def write(path, lines):
    path.write_text(HEADER + "".join(line + "\n" for line in lines))
    return str(path)


def circle(count, start=32000):
    """Readings of a robot on a circle, through the counters' wrap."""
    return [
        tuple((start + 60 * i + 32768) % 65536 - 32768 if wheel else 50 * i for wheel in (1, 0))
        for i in range(count)
    ]


def checked_lines(readings, gap=()):
    """Entries of a checked stream at 50 Hz; numbers in `gap` are lost."""
    yield f"0.0 {JOINED}"
    for i, (right, left) in enumerate(readings):
        if i not in gap:
            ticks = (i * 312 + 32768) % 65536 - 32768
            wire = encode_reply(8, right, left, 100, 100, 100, stamp=Stamp(i, ticks), checked=True)
            yield f"{0.01 + i * 0.02:.6f} < {wire.decode().strip()}\\r\\n"


def drive(path, gap=(), count=400):
    return write(path, [f"0.0 < {INFO}", *checked_lines(circle(count), gap)])


def true_pose(readings):
    odometry = Odometry(load("traxbot").drive, 10.0)
    for i, (right, left) in enumerate(readings):
        odometry.update(right, left, i * 0.02)
    return odometry.pose


def cut(path, size):
    """The same recording, its checked frames in entries of `size` bytes."""
    _, info, _, *entries = Recording(path)
    data = b"".join(entry.data for entry in entries).decode()
    pieces = [data[i : i + size].encode("unicode_escape").decode() for i in range(0, len(data), size)]
    times = [entries[-1].time_s * (i + 1) / len(pieces) for i in range(len(pieces))]
    lines = [f"{time_s:.6f} < {piece}" for time_s, piece in zip(times, pieces)]
    return write(pathlib.Path(path), [f"0.0 < {INFO}", f"0.0 {JOINED}", *lines])


def summary(tmp_path, *lines):
    return summarise(RecordedDriver(write(tmp_path / "log", lines)))


@pytest.mark.parametrize("size", [1, 300, 1 << 20])
def test_frames_losses_and_pose_are_those_of_the_stream_however_it_is_cut(tmp_path, size):
    gap = {7, 8, 300}
    found = summarise(RecordedDriver(cut(drive(tmp_path / "log", gap), size)))
    expected = true_pose(circle(400))
    assert found["frames"] == {"robot_info": 1, "read_encoders_and_sonars": 397}
    assert (found["lost"], found["duration_s"]) == (3, pytest.approx(7.99))
    assert found["pose"]["x_m"] == pytest.approx(expected.x_m, abs=WAY_M)
    assert found["pose"]["y_m"] == pytest.approx(expected.y_m, abs=WAY_M)
    turned_rad = math.remainder(found["pose"]["yaw_rad"] - expected.yaw_rad, math.tau)
    assert turned_rad == pytest.approx(0, abs=YAW_RAD)


def test_damage_repetitions_and_requests_are_counted(tmp_path):
    guarded = encode_request(32, 1).decode()
    lines = [f"0.0 < {INFO}", "0.1 < @6,1,+2e", "0.2 < @6,1,2,3e", "0.3 < boo\\r\\n"]
    checked = [f"1{line}" for line in checked_lines(circle(5))]
    found = summary(tmp_path, *lines, "0.4 > @5e@13e", f"0.5 > {guarded}", *checked, checked[-1])
    assert found["garbage"] == {"argument_count": 1, "not_integer": 1, "text": 1}
    assert found["requests"] == {"robot_info": 1, "stop": 1, "set_check": 1}
    assert (found["duplicates"], found["lost"]) == (1, 0)


def test_a_recording_without_a_robot_has_no_pose(tmp_path):
    found = summary(tmp_path, "0.0 < @6,1,2e")
    assert (found["robot"], found["robot_id"], found["pose"]) == (None, None, None)


MEASURE = """
import resource, sys
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
for path in sys.argv[1:]:
    frames = summarise(RecordedDriver(path))["frames"]
    print(frames["read_encoders_and_sonars"], resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
MEMORY_KB = 4000


def test_memory_does_not_grow_with_the_file(tmp_path):
    """1 MB of frames against 4 MB with 50 MB of NULs behind, as a crash leaves them."""
    readings = list(checked_lines(circle(600)))[1:]
    data = "".join(line.split(" ", 2)[2] for line in readings)
    for name, lines, nuls in (("short", 40, 0), ("long", 160, 50_000_000)):
        write(tmp_path / name, [f"0.0 {JOINED}", *[f"1.0 < {data}"] * lines])
        os.truncate(tmp_path / name, os.path.getsize(tmp_path / name) + nuls)
    command = [sys.executable, "-c", MEASURE, tmp_path / "short", tmp_path / "long"]
    out = subprocess.run(command, capture_output=True, text=True, check=True, timeout=PATIENCE_S).stdout
    (few, before_kb), (many, after_kb) = (map(int, line.split()) for line in out.splitlines())
    assert (few, many) == (40 * 600, 160 * 600)
    assert after_kb - before_kb < MEMORY_KB


def mrl(*args):
    command = [MRL, "replay", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)


@pytest.mark.parametrize(
    "args, text",
    [
        (("FILE", "--speed", "2"), "without --pty"),
        (("FILE", "--pty", "--speed", "-1"), "'--speed': -1.0, expected 0 to 1000000"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_one_line_and_exit_code_2(tmp_path, args, text):
    path = drive(tmp_path / "log", count=3)
    done = mrl(*(path if word == "FILE" else word for word in args))
    assert done.returncode == 2
    assert text in done.stderr
    assert done.stderr.count("\n") == 1


class Replay:
    def __init__(self, *args):
        command = [MRL, "replay", "--pty", *map(str, args)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.path = self.process.stdout.readline().strip()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        self.process.stdout.close()
        self.process.stderr.close()


def read_to_the_end(client):
    out = b""
    os.set_blocking(client.fd, True)
    while True:
        try:
            data = os.read(client.fd, 4096)
        except OSError:
            return out
        if not data:
            return out
        out += data


def test_a_pty_gets_every_byte_of_the_board(tmp_path):
    path, link = drive(tmp_path / "log"), tmp_path / "link"
    expected = b"".join(entry.data for entry in Recording(path) if entry.direction == FROM_BOARD)
    with Replay(path, "--speed", 0, "--link", link) as replayed:
        assert os.readlink(link) == replayed.path
        with Client(replayed.path) as client:
            assert read_to_the_end(client) == expected
        assert replayed.process.wait(PATIENCE_S) == 0
        assert replayed.process.stderr.read() == f"mrl: {path} is over\n"
    assert not os.path.lexists(link)


@pytest.fixture
def playing(monkeypatch):
    """Plays a recording on a pty in a thread; gives the pty's path, and what awaits the end and has what was told."""
    monkeypatch.setattr(playback, "LISTENER_S", 60.0)
    ports = []

    def play(path, speed=1.0):
        told, port = [], PtyPort()
        ports.append(port)
        args = Recording(path), port, speed, told.append
        thread = threading.Thread(target=playback.play, args=args, daemon=True)
        thread.start()

        def end():
            thread.join(PATIENCE_S)
            assert not thread.is_alive()
            return told

        return port.path, end

    yield play
    for port in ports:
        port.close()


GREETING = ["0 > @13e@5e", f"0 < {INFO}", "0 > @19e@29e", "0 < @29,2,415e\\r\\n", "0 > @18,20e"]


def test_answers_wait_until_the_program_asks(tmp_path, playing):
    """What comes before it is lost to a program that empties the port when it opens it, as the driver does."""
    path, end = playing(write(tmp_path / "log", [*GREETING, "0 < @8,1,2,3,4,5e\\r\\n"]))
    with Client(path) as client:
        assert client.ask(b"@13e@5e") == b"@5,2500,172,1360,2,1e\r\n"
        assert client.ask(b"@29e") == b"@29,2,415e\r\n"
        assert client.ask(b"@18,20e") == b"@8,1,2,3,4,5e\r\n"
        assert end() == []


@pytest.mark.parametrize("speed, programs", [(math.inf, 1), (0.25, 2)])
def test_drivers_connect_one_after_the_other(tmp_path, playing, speed, programs):
    """Each switches the check value on anew, as the recorded one did."""
    log, board = str(tmp_path / "log"), Emulator()
    try:
        with Driver(board.path, options=Options(record=log)) as driver:
            driver.wait(1.0)
    finally:
        board.close()
    path, end = playing(log, speed)
    for program in range(1, programs + 1):
        with Driver(path, options=Options(reconnect=False)) as driver:
            assert driver.board.protocol == 2
            if program == programs:
                assert len(end()) == programs - 1


@pytest.mark.parametrize("speed, seconds", [(2.0, 0.05), (1.0, 0.1)])
def test_bytes_come_at_their_time(speed, seconds):
    """Never earlier; times of the recording count from its first byte."""
    pace, start_s = playback.ReplayPace(speed, time.sleep), time.monotonic()
    for time_s in (5.0, 5.1):
        pace.await_time(time_s)
    assert time.monotonic() - start_s >= seconds
