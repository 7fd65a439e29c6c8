"""Recordings come back byte for byte, and survive crashes, full disks and editors."""

import codecs
import errno
import gzip
import io
import itertools
import json
import os
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.files import create_unused
from mrl_driver.geometry import Pose
from mrl_driver.recording import recording
from mrl_driver.recording.recorded_facts import Gap, gap_of, model_text
from mrl_driver.recording.recorded_link import DriverRecording, RecordedLink
from mrl_driver.recording.recording import (
    CLOCK,
    ENDS,
    FROM_BOARD,
    LACKS,
    LONGEST_LINE,
    REMARK,
    TO_BOARD,
    Recorder,
    Recording,
    read_lines,
    started_s,
)
from mrl_driver.robot import models
from mrl_driver.robot.covariance import AT_START
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Lost
from mrl_driver.session.handshake import Board
from tests.waiting import PATIENCE_S, wait_until

HEADER = '#mrl-recording 1 {"port": "x"}\n'


def record(path, chunks, **header):
    recorder = Recorder(str(path), **header)
    for direction, data in chunks:
        recorder.add(direction, data)
    recorder.close()
    return recorder


def kept(path):
    """Direction and data of the entries, without the mark of the end."""
    *entries, end = Recording(str(path))
    assert (end.direction, end.data) == (REMARK, ENDS)
    return [(entry.direction, entry.data) for entry in entries]


def read(tmp_path, text):
    path = tmp_path / "log"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    recording = Recording(str(path))
    return recording, list(recording)


@given(st.lists(st.tuples(st.sampled_from([TO_BOARD, FROM_BOARD]), st.binary(max_size=60)), max_size=20))
@example([(FROM_BOARD, b"@6,1e\r\n"), (TO_BOARD, b"\x00\r\n"), (FROM_BOARD, b"\\\r\n"), (FROM_BOARD, b"")])
def test_bytes_come_back(tmp_path_factory, chunks):
    path = tmp_path_factory.mktemp("log") / "log"
    record(path, chunks)
    assert kept(path) == chunks


def test_what_was_added_is_on_the_disk_within_a_second(tmp_path):
    """A program that is killed loses no more."""
    recorder = Recorder(str(tmp_path / "log"))
    recorder.add(FROM_BOARD, b"@6,1,2e")
    assert recording.FLUSH_S + recording.HOLD_S <= 0.25 and (
        recorder.lost,
        recorder.error,
        recorder.loss,
    ) == (0, "", "")
    wait_until(lambda: b"@6,1,2e" in (tmp_path / "log").read_bytes())
    assert ("recorder", True) in [(each.name, each.daemon) for each in threading.enumerate()]
    recorder.close()
    assert "recorder" not in [each.name for each in threading.enumerate()]


def test_what_was_written_is_put_on_the_disk_by_the_thread_that_writes(tmp_path, monkeypatch):
    """Linux keeps it in memory for half a minute, and a loss of power costs all of that."""
    path, synced = tmp_path / "log", []
    monkeypatch.setattr(recording, "SYNC_S", 0.0)
    monkeypatch.setattr(
        os, "fdatasync", lambda fd: synced.append((threading.current_thread().name, path.read_bytes()))
    )
    recorder = Recorder(str(path))
    recorder.add(FROM_BOARD, b"@6,1,2e")
    wait_until(lambda: any(name == "recorder" and b"@6,1,2e" in data for name, data in synced))
    recorder.add(FROM_BOARD, b"@6,3,4e")
    recorder.close()
    assert b"@6,3,4e" in synced[-1][1]


@pytest.fixture
def wall(monkeypatch):
    """By how much the wall clock was set [s], in a list."""
    ahead, now = [0.0], time.time
    monkeypatch.setattr(time, "time", lambda: now() + ahead[0])
    return ahead


def set_clock(recorder, wall, ahead_s):
    """Set the wall clock; the thread has seen it when a later line is in the file."""
    wall[0] = ahead_s
    line = b"at %r" % ahead_s
    recorder.add(FROM_BOARD, line)
    wait_until(lambda: line in Path(recorder.path).read_bytes())


def clocks(path):
    """The wall clock at the beginning, and after each time that it was set, without the driver's [s]."""
    recording = Recording(str(path))
    told = [float(entry.data[len(CLOCK) :]) for entry in recording if entry.data.startswith(CLOCK)]
    return [started_s(recording.header) - recording.start_us / 1e6, *told]


def test_a_wall_clock_that_is_set_is_noted_once(tmp_path, wall):
    """A computer without a clock of its own gets the time from the network, minutes after its start."""
    recorder = Recorder(str(tmp_path / "log"))
    for ahead_s in (1000.0, 1000.05):
        set_clock(recorder, wall, ahead_s)
    recorder.close()
    before, after = clocks(tmp_path / "log")
    assert after - before == pytest.approx(1000.0, abs=recording.SET_S)


def test_a_program_that_notes_the_clock_itself_is_the_only_one(tmp_path, wall):
    """It knows the time to the frame, as the ROS node, whose stamps have it."""
    recorder = Recorder(str(tmp_path / "log"))
    recorder.add(REMARK, CLOCK + b"7.5")
    set_clock(recorder, wall, 1000.0)
    recorder.close()
    assert clocks(tmp_path / "log")[1:] == [7.5]


def recorded_late(path, monkeypatch, meanwhile):
    """Data of a recording in which a thread pauses between the time of `late` and its line, and the lines skipped."""
    recorder, clock, paused = Recorder(str(path)), time.monotonic_ns, []
    caller = threading.current_thread()

    def pausing():
        now = clock()
        if not paused and threading.current_thread() is caller:
            paused.append(True)
            recorder.add(FROM_BOARD, b"other")
            meanwhile()
        return now

    monkeypatch.setattr(time, "monotonic_ns", pausing)
    recorder.add(TO_BOARD, b"late")
    recorder.close()
    return [data for _, data in kept(path)], Recording(str(path)).skipped_count


def test_a_thread_that_pauses_while_it_records_keeps_the_order(tmp_path, monkeypatch):
    assert recorded_late(tmp_path / "log", monkeypatch, lambda: None) == ([b"late", b"other"], 0)


def test_a_line_waits_for_an_older_one_of_another_thread(tmp_path, monkeypatch):
    """Each line keeps its own time, which a replay needs."""
    monkeypatch.setattr(recording, "FLUSH_S", 0.002)
    monkeypatch.setattr(recording, "HOLD_S", PATIENCE_S)
    recorder, now = Recorder(str(tmp_path / "log")), recording.now_s()
    recorder.add(TO_BOARD, b"other", now + 0.002)
    time.sleep(0.02)
    recorder.add(FROM_BOARD, b"late", now + 0.001)
    recorder.close()
    first, second, _ = Recording(str(tmp_path / "log"))
    assert (first.data, second.data) == (b"late", b"other")
    assert second.time_s - first.time_s == pytest.approx(0.001, abs=1e-6)


def test_a_program_that_starts_again_keeps_its_recordings(tmp_path):
    """Devices have no number."""
    names = [str(tmp_path / name) for name in ("run.mrl", "run-2.mrl", "run-3.mrl")]
    assert [create_unused(names[0]) for _ in names] == names
    assert create_unused("/dev/full") == "/dev/full"


def test_a_recording_is_for_its_user_alone(tmp_path):
    record(tmp_path / "log", [])
    assert (tmp_path / "log").stat().st_mode & 0o777 == 0o600


def test_a_recording_that_is_being_written_is_not_replaced(tmp_path):
    """Two programs may have asked whether the file exists before either wrote."""
    first = Recorder(str(tmp_path / "log"))
    with pytest.raises(ConfigError, match="another recording is being written to it"):
        Recorder(str(tmp_path / "log"))
    first.add(FROM_BOARD, b"@6,1,2e")
    first.close()
    assert kept(tmp_path / "log") == [(FROM_BOARD, b"@6,1,2e")]
    record(tmp_path / "log", [])


def test_a_disk_that_is_too_slow_costs_the_lines_that_wait_for_no_place(tmp_path, monkeypatch):
    """20 000 lines, of the time in which the disk may pause."""
    monkeypatch.setattr(recording, "FLUSH_S", PATIENCE_S)
    recorder = record(tmp_path / "log", [(FROM_BOARD, b"")] * 20003)
    assert (recorder.lost, recorder.error) == (3, "the disk is too slow")
    *lines, lack, _ = Recording(str(tmp_path / "log"))
    assert len(lines) == 20000 and gap_of(lack.data[len(LACKS) :], lack.time_s) == Gap(
        lines[-1].time_s, lack.time_s, 3, "the disk is too slow"
    )


@pytest.mark.parametrize(
    "header, time_s",
    [
        ({"started": "2026-03-01T12:00:00+00:00"}, 1772366400.0),
        ({}, 0.0),
        ({"started": "x"}, 0.0),
    ],
)
def test_the_time_of_the_start_is_that_of_the_header(header, time_s):
    assert started_s(header) == time_s


def test_a_recording_begins_now_by_both_clocks(tmp_path):
    record(tmp_path / "log", [], port="x")
    header = Recording(str(tmp_path / "log")).header
    assert started_s(header) == pytest.approx(time.time(), abs=PATIENCE_S)
    assert header["clock_us"] == pytest.approx(time.monotonic() * 1e6, abs=PATIENCE_S * 1e6)
    assert header["port"] == "x" and header["started"].endswith("+00:00")


def test_a_full_disk_is_counted_and_named():
    recorder = Recorder("/dev/full")
    recorder.add(FROM_BOARD, b"@6,1,2e")
    recorder.close()
    assert (recorder.lost, recorder.error) == (2, os.strerror(28))


def test_the_reason_of_a_loss_is_kept_when_there_is_room_again(tmp_path, monkeypatch):
    recorder, write, full = Recorder(str(tmp_path / "log")), os.write, [True]

    def write_if_there_is_room(fd, data):
        if full:
            full.clear()
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(fd, data)

    monkeypatch.setattr(os, "write", write_if_there_is_room)
    recorder.add(FROM_BOARD, b"lost")
    wait_until(lambda: recorder.lost)
    recorder.add(FROM_BOARD, b"kept")
    recorder.close()
    assert f"lacks 1 lines: {os.strerror(errno.ENOSPC)}" in recorder.loss
    (_, lack), line = kept(tmp_path / "log")
    assert line == (FROM_BOARD, b"kept")
    assert json.loads(lack[len(LACKS) :]) == {"lines": 1, "since_s": 0.0, "reason": os.strerror(errno.ENOSPC)}


def test_a_lack_begins_after_the_last_line_that_is_whole(tmp_path, monkeypatch):
    """The disk takes one line and a part of the next."""
    now_s = [0.0]
    recorder, write = Recorder(str(tmp_path / "log"), clock=lambda: now_s[0]), os.write
    for now_s[0] in (1.0, 2.0, 3.0):
        recorder.add(FROM_BOARD, b"12345")
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", lambda fd, data: write(fd, data[:20]))
        recorder.close()
    assert recorder.lost == 2 and (tmp_path / "log").read_text().endswith("\n1.000000 < 12345\n")
    assert Recording(str(tmp_path / "log")).skipped == {}


def test_the_line_after_one_that_the_disk_took_in_part_is_whole(tmp_path, monkeypatch):
    recorder, write = Recorder(str(tmp_path / "log")), os.write
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", lambda fd, data: write(fd, data[:-3]))
        recorder.add(FROM_BOARD, b"torn")
        wait_until(lambda: recorder.lost)
    recorder.add(FROM_BOARD, b"whole")
    recorder.close()
    assert (recorder.lost, recorder.error) == (1, "the disk accepted only a part of a line")
    reason = f'"reason": "{recorder.error}"}}'.split()
    assert [line.split(" ")[2:] for line in (tmp_path / "log").read_text().splitlines()[1:]] == [
        ["file_lacks", '{"lines":', "1,", '"since_s":', "0.0,", *reason],
        ["whole"],
        ["file_ends"],
    ]


def test_a_pipe_that_nobody_reads_is_refused(tmp_path):
    """It would hold the caller, who may be driving, until somebody does."""
    pipe = str(tmp_path / "pipe")
    os.mkfifo(pipe)
    with pytest.raises(ConfigError, match="cannot record to"):
        Recorder(pipe)


def test_a_torn_last_line_is_skipped_and_a_blank_one_is_passed_over(tmp_path):
    recording, entries = read(tmp_path, HEADER + "0.1 < @6,1,2e\n\n0.15 < @6,1,3e\n0.2 < @6,1")
    assert (len(entries), recording.skipped) == (2, {5: "incomplete"})


@pytest.mark.parametrize(
    "line, problem",
    [
        ("x < @6e", "time is b'x', expected seconds"),
        (f"{'x' * 30} < @6e", f"time is b'{'x' * 20}', expected"),
        ("-1 < @6e", "time is -1.0"),
        ("nan < @6e", "time is nan"),
        ("1000000000 < @6e", "time is 1000000000.0, expected 0 or more seconds"),
        ("0.05 < @6e", "time 0.05 is before 0.1"),
        ("0.2 = @6e", "direction is b'='"),
        (f"0.2 {'=' * 30} @6e", f"direction is b'{'=' * 20}', expected"),
        ("0.2 < \\x4", "not escaped"),
        (f"0.2 < {'a' * 20}\\x4", f"bytes b'{'a' * 20}' are not escaped"),
        ("\x00\x00\x00", "time is"),
    ],
)
def test_a_bad_line_is_skipped_with_its_number(tmp_path, line, problem):
    recording, entries = read(tmp_path, HEADER + f"0.1 < a\n{line}\n0.3 < b\n")
    assert [entry.data for entry in entries] == [b"a", b"b"]
    assert problem in recording.skipped[3]


def test_lines_that_wait_for_their_order_are_few():
    """A line waits for those behind it, which may all be damaged: memory must not grow with them."""
    file, skipped = io.BytesIO(b"0.1 < a\n" + b"x\n" * 5000 + b"0.2 < b\n"), []
    entries = read_lines(file, lambda number, problem: skipped.append(number))
    assert next(entries).data == b"a" and file.tell() < 3000
    assert next(entries).data == b"b" and skipped == [*range(3, 5003)]


@pytest.mark.parametrize("late, kept", [(3, b"abbbb"), (4, b"cccc")])
def test_a_time_is_damaged_if_most_of_the_seven_behind_it_are_earlier(tmp_path, late, kept):
    lines = ["9 < a", *["10 < b"] * (7 - late), *["0 < c"] * late]
    recording, entries = read(tmp_path, HEADER + "\n".join(lines) + "\n")
    assert b"".join(entry.data for entry in entries) == kept


def test_the_first_hundred_bad_lines_are_named_and_all_are_counted_each_time(tmp_path):
    recording, _ = read(tmp_path, HEADER + "0.1 < a\nx\n" * 150)
    assert recording.skipped_count == 150
    assert len(list(recording)) == recording.skipped_count == 150
    assert [*recording.skipped] == [*range(3, 203, 2)]


def test_a_file_is_read_if_half_of_its_lines_are_good(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "_MOST_SKIPPED", 10)
    assert len(read(tmp_path, HEADER + "0.1 < a\n" * 15 + "x\n" * 16)[1]) == 15


def test_a_file_that_is_damaged_beyond_use_is_refused_soon(tmp_path):
    path = tmp_path / "log"
    path.write_bytes(HEADER.encode() + b"0.1 < a\n" * 50_000 + b"x\n" * 100_001)
    with pytest.raises(ConfigError, match="100001 of the lines so far cannot be read .* copy the file again"):
        list(Recording(str(path)))


@pytest.mark.parametrize(
    "text, message",
    [
        ("", "log:1: got b'', expected '#mrl-recording 1"),
        ("@6,1,2e\n", "not a recording"),
        (b"\x00" * 50, "not a recording"),
        ("#mrl-recording 2 {}\n", "recording version 2, expected at most 1"),
        ("#mrl-recording 1 {", "damaged"),
        pytest.param("#mrl-recording 1 " + "[" * 100000, "damaged", id="deep"),
    ],
)
def test_what_is_no_recording_is_refused(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        read(tmp_path, text)


RECORDED = (HEADER + "10.100000 < a\n10.200000 < b\n").encode()


@pytest.mark.parametrize(
    "text, message",
    [
        (gzip.compress(RECORDED), "compressed by gzip; unpack it with gunzip"),
        (b"PK\x03\x04...", "zip archive; unpack it"),
        (RECORDED.decode().encode("utf-16"), "UTF-16; save it as UTF-8"),
        (codecs.BOM_UTF16_BE + RECORDED.decode().encode("utf-16-be"), "UTF-16; save it as UTF-8"),
    ],
    ids=["gzip", "zip", "utf-16", "utf-16-be"],
)
def test_a_recording_in_another_form_is_named_with_what_to_do(tmp_path, text, message):
    with pytest.raises(ConfigError, match=message):
        read(tmp_path, text)


@pytest.mark.parametrize(
    "before",
    [codecs.BOM_UTF8, b"\n", b"\r\n \n", codecs.BOM_UTF8 + b"\n"],
    ids=["mark", "line", "lines", "mark and line"],
)
def test_a_byte_order_mark_and_empty_lines_before_the_header_are_skipped(tmp_path, before):
    recording, entries = read(tmp_path, before + RECORDED + b"x\n")
    assert recording.header == {"port": "x"} and entries == [(10.1, "<", b"a"), (10.2, "<", b"b")]
    assert [*recording.skipped] == [before.count(b"\n") + 4]


@pytest.mark.parametrize(
    "first", ["#mrl-recordinX 1 {}", '#mrl-recording 1 {"port": "\xff"', "\x00\x00", "x" * 70000]
)
def test_a_damaged_first_line_costs_itself_alone(tmp_path, first):
    recording, entries = read(tmp_path, RECORDED.replace(HEADER[:-1].encode(), first.encode()))
    assert entries == [(10.1, "<", b"a"), (10.2, "<", b"b")]
    assert recording.header == {} and [*recording.skipped] == [1]


def test_a_damaged_digit_of_a_time_costs_its_own_line(tmp_path):
    times = [f"{i / 50:.6f}" for i in range(100)]
    times[40] = "9" + times[40][1:]
    (tmp_path / "log").write_text("#mrl-recording 1 {}\n" + "".join(f"{each} < a\n" for each in times))
    recording = Recording(str(tmp_path / "log"))
    assert len(list(recording)) == 99
    assert recording.skipped == {42: "time 9.8 is after that of most of the 7 lines behind it"}


def test_a_header_may_be_missing_or_have_no_facts(tmp_path):
    lines = RECORDED.decode().partition("\n")[2]
    for first, number in (("", 1), ("\n", 1), ("\n\n", 2)):
        recording, entries = read(tmp_path, first + lines)
        assert len(entries) == 2 and [*recording.skipped] == [number]
    recording, entries = read(tmp_path, "#mrl-recording 1\n" + lines)
    assert (len(entries), recording.header, recording.skipped) == (2, {}, {})


def test_a_line_that_is_too_long_is_skipped(tmp_path):
    long = b"0.5 < " + b"a" * (LONGEST_LINE - 6)
    assert len(read(tmp_path, HEADER.encode() + long[:-1] + b"\n")[1]) == 1
    (tmp_path / "log").write_bytes(b"#mrl-recording 1 {}\n0.1 < a\n" + long + b"\n0.6 < b\n")
    recording = Recording(str(tmp_path / "log"))
    assert [each.data for each in recording] == [b"a", b"b"]
    assert recording.skipped == {3: f"longer than {LONGEST_LINE} bytes"}


# -- links that are recorded


def wire(calls, *reads):
    """A link that notes what is called, and reads this."""
    found = {"read": iter(reads).__next__, "fileno": lambda: 7}

    def call(name):
        return lambda *args: (calls.append((name, *args)), found.get(name, str)())[1]

    names = ("read", "write", "wake", "close", "fileno", "set_baud")
    return SimpleNamespace(port="p\udcff", **{name: call(name) for name in names})


def test_a_recorded_link_passes_all_on_and_tells_each_chunk():
    """Before it is written, and after it was read."""
    calls = []
    link = RecordedLink(wire(calls, b"in", b""), lambda *chunk: calls.append(chunk))
    assert (link.read(0.5), link.read(0.1), link.fileno(), link.port) == (b"in", b"", 7, "p\udcff")
    link.write(b"out")
    link.wake()
    link.set_baud(9600)
    link.close()
    begin = [("read", 0.5), ("<", b"in"), ("read", 0.1), ("fileno",), (">", b"out"), ("write", b"out")]
    assert calls == [*begin, ("wake",), ("set_baud", 9600), ("close",)]


@pytest.fixture
def made(tmp_path):
    """The recording of a driver whose clock goes on by 1 s with each look; its file, and what its `tap` gets."""
    clock, taps = itertools.count(), []
    made = DriverRecording(
        "p", 9600, lambda *chunk: taps.append(chunk), {"check": True}, lambda: float(next(clock))
    )
    made.remark(b"nobody records it yet")
    made.use(made.create(str(tmp_path / "log")))
    made.taps, made.path = taps, str(tmp_path / "log")
    return made


def test_what_a_driver_does_is_recorded_with_the_time_that_it_uses(made):
    assert made.due
    link = made.begin(wire([], b"in"))
    made.new(2.0)
    assert not made.due and link.read(0.0) == b"in"
    link.write(b"out")
    made.heard(b"in", 9.0)
    made.heard(b"", 10.0)
    made.clock(1.5)
    made.again(11.0, same=True)
    made.lost(Lost("p", "gone"), True, 12.0)
    recorder = made.stop()
    assert made.due and made.stop() is None
    made.remark(b"too late")
    recorder.close()
    recorded = Recording(made.path)
    assert [*recorded] == [
        *((1.0, "!", b"opened p?"), (2.0, "!", b"session new"), (2.0, ">", b"out"), (9.0, "<", b"in")),
        *((10.0, "!", b"clock 1.5"), (11.0, "!", b"session again same")),
        (12.0, "!", b'lost {"port": "p", "reason": "gone", "may_move": false, "reported": true}'),
        (12.0, "!", b"file_ends"),
    ]
    facts = {"port": "p", "baud": 9600, "options": {"check": True}, "clock_us": 0}
    assert facts.items() <= recorded.header.items() and made.taps == [("<", b"in"), (">", b"out")]


@pytest.mark.parametrize(
    "ready, telemetry, stamp_s", [(True, 3.5, 3.5), (True, None, 4.5), (False, None, None)]
)
def test_a_recording_that_begins_in_mid_run_has_what_came_before(made, ready, telemetry, stamp_s):
    """And the bytes of the frame that has begun."""
    motion = SimpleNamespace(stops=3, stop_reason="user")
    session = SimpleNamespace(
        ready=ready, checked=True, stream_code=6, last_frame=None, heard_s=4.5, pending=b"@6"
    )
    session.out, session.motion, board = (
        b"",
        motion,
        Board(1, 2, 1.72, 12.0, 25.0, 2, frozenset({"imu", "check"})),
    )
    heading = SimpleNamespace(known_bias=(0.5, 0.25, 0.125))
    state = SimpleNamespace(
        info=board,
        model=models.load("traxbot"),
        telemetry=telemetry and SimpleNamespace(stamp_s=telemetry),
        tracker=telemetry and SimpleNamespace(heading=heading),
        odometry=SimpleNamespace(
            pose=Pose(1.0, 2.0, 3.0), uncertainty=telemetry and SimpleNamespace(spread=range(6))
        ),
    )
    made.exchange(wire([]), session, state)
    made.turned(b"", (), session, state)
    wheels = [Mismatch(name, "blocked", 0.5, 0.25) for name in ("left", "right")]
    made.turned(b"", wheels, session, state)
    made.close()
    opened, checked, model, joined, pose, pending, silence, stop, _ = Recording(made.path)
    spread = " ".join(map(repr, map(float, range(6) if telemetry else AT_START))).encode()
    assert model.data == b"model " + model_text(state.model).encode() and silence == (2.0, "<", b"")
    assert stop.data == b'stop user {"wheel": "left", "cause": "blocked", "expected_m": 0.5, "moved_m": 0.25}'
    assert (checked.data, pose.data, pending[1:]) == (
        b"checked",
        b"pose 1.0 2.0 3.0 " + spread,
        ("<", b"@6"),
    )
    assert {each.time_s for each in (checked, model, joined, pose, pending, stop)} == {2.0}
    if not ready:
        assert joined.data == b"session again other"
        return
    found = json.loads(joined.data.partition(b"joined ")[2])
    bias = [0.5, 0.25, 0.125] if telemetry else None
    assert (found["stamp_s"], found["bias"], found["frame"], found["stream"]) == (stamp_s, bias, "", 6)


def test_a_link_is_recorded_if_somebody_wants_its_bytes(made):
    assert isinstance(made.begin(wire([])), RecordedLink)
    made.close()
    assert kept(made.path) == [(REMARK, b"opened p?")]
    idle = DriverRecording("p", 9600, None, {}, None)
    assert not isinstance(idle.begin(wire([])), RecordedLink)
