"""Recordings come back byte for byte, and survive crashes, full disks and editors."""

import codecs
import errno
import gzip
import io
import os
import threading
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.files import create_unused
from mrl_driver.recording import recording
from mrl_driver.recording.recording import FROM_BOARD, LONGEST_LINE, TO_BOARD, Recorder, Recording, read_lines
from tests.waiting import PATIENCE_S, wait_until

HEADER = '#mrl-recording 1 {"port": "x"}\n'


def record(path, chunks, **header):
    recorder = Recorder(str(path), **header)
    for direction, data in chunks:
        recorder.add(direction, data)
    recorder.close()
    return recorder


def read(tmp_path, text):
    path = tmp_path / "log"
    path.write_bytes(text if isinstance(text, bytes) else text.encode("latin-1"))
    recording = Recording(str(path))
    return recording, list(recording)


@given(st.lists(st.tuples(st.sampled_from([TO_BOARD, FROM_BOARD]), st.binary(max_size=60)), max_size=20))
def test_bytes_come_back(tmp_path_factory, chunks):
    path = tmp_path_factory.mktemp("log") / "log"
    record(path, chunks)
    assert [(entry.direction, entry.data) for entry in Recording(str(path))] == chunks


def test_what_was_added_is_on_the_disk_within_a_second(tmp_path):
    """A program that is killed loses no more."""
    recorder = Recorder(str(tmp_path / "log"))
    recorder.add(FROM_BOARD, b"@6,1,2e")
    assert recording.FLUSH_S <= 0.5
    wait_until(lambda: b"@6,1,2e" in (tmp_path / "log").read_bytes())
    recorder.close()


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
    recording = Recording(str(path))
    return [entry.data for entry in recording], recording.skipped_count


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
    first, second = Recording(str(tmp_path / "log"))
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
    assert [entry.data for entry in Recording(str(tmp_path / "log"))] == [b"@6,1,2e"]
    record(tmp_path / "log", [])


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


def test_a_pipe_that_nobody_reads_is_refused(tmp_path):
    """It would hold the caller, who may be driving, until somebody does."""
    pipe = str(tmp_path / "pipe")
    os.mkfifo(pipe)
    with pytest.raises(ConfigError, match="cannot record to"):
        Recorder(pipe)


def test_a_torn_last_line_is_skipped(tmp_path):
    recording, entries = read(tmp_path, HEADER + "0.1 < @6,1,2e\n0.2 < @6,1")
    assert (len(entries), recording.skipped) == (1, {3: "incomplete"})


@pytest.mark.parametrize(
    "line, problem",
    [
        ("x < @6e", "time is b'x', expected seconds"),
        ("-1 < @6e", "time is -1.0"),
        ("nan < @6e", "time is nan"),
        ("0.05 < @6e", "time 0.05 is before 0.1"),
        ("0.2 = @6e", "direction is b'='"),
        ("0.2 < \\x4", "not escaped"),
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


RECORDED = (HEADER + "0.100000 < a\n0.200000 < b\n").encode()


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


@pytest.mark.parametrize("before", [codecs.BOM_UTF8, b"\n", b"\r\n \n", codecs.BOM_UTF8 + b"\n"], ids=repr)
def test_a_byte_order_mark_and_empty_lines_before_the_header_are_skipped(tmp_path, before):
    recording, entries = read(tmp_path, before + RECORDED + b"x\n")
    assert recording.header == {"port": "x"} and [entry.data for entry in entries] == [b"a", b"b"]
    assert [*recording.skipped] == [before.count(b"\n") + 4]


@pytest.mark.parametrize(
    "first", ["#mrl-recordinX 1 {}", '#mrl-recording 1 {"port": "x"', "\x00\x00", "x" * 70000]
)
def test_a_damaged_first_line_costs_itself_alone(tmp_path, first):
    recording, entries = read(tmp_path, RECORDED.replace(HEADER[:-1].encode(), first.encode()))
    assert [entry.data for entry in entries] == [b"a", b"b"]
    assert recording.header == {} and [*recording.skipped] == [1]


def test_a_damaged_digit_of_a_time_costs_its_own_line(tmp_path):
    times = [f"{i / 50:.6f}" for i in range(100)]
    times[40] = "9" + times[40][1:]
    (tmp_path / "log").write_text("#mrl-recording 1 {}\n" + "".join(f"{each} < a\n" for each in times))
    recording = Recording(str(tmp_path / "log"))
    assert len(list(recording)) == 99
    assert recording.skipped == {42: "time 9.8 is after that of most of the 7 lines behind it"}


def test_a_line_that_is_too_long_is_skipped(tmp_path):
    long = b"0.5 < " + b"a" * LONGEST_LINE
    (tmp_path / "log").write_bytes(b"#mrl-recording 1 {}\n0.1 < a\n" + long + b"\n0.6 < b\n")
    recording = Recording(str(tmp_path / "log"))
    assert [each.data for each in recording] == [b"a", b"b"]
    assert recording.skipped == {3: f"longer than {LONGEST_LINE} bytes"}
