"""Summaries of long recordings: the reader of many lines and frames at once gives what reading one by one gives."""

import codecs
import math
import random
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder, Stamp, encode_reply, encode_request
from mrl_driver.protocol.frames import check_value, to_int16
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.recording import lines
from mrl_driver.recording.frame_arrays import FrameArrayDecoder
from mrl_driver.recording.recording import Recording
from mrl_driver.recording.summary import summarise
from mrl_driver.robot.heading import HeadingFilter
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.omni_odometry import STREAM, OmniOdometry

from . import plain_recording

EQUAL_M = 1e-9
"""Poses differ by the rounding of sums in another order."""
OMNI = BY_NAME[STREAM].code
seeds = st.integers(0, 2**32).map(random.Random)
few = settings(max_examples=30, deadline=None)


def maybe(rng, share):
    return rng.random() < share


# -- recordings with everything that may be in one


def stretch(rng, robot_id, checked):
    """Entries of one conversation, as pairs of direction and bytes."""
    sequence, right, left = rng.randrange(65536), rng.randrange(65536), rng.randrange(65536)
    code = OMNI if robot_id == 21 else rng.choice([6, 8])
    if maybe(rng, 0.8):
        yield "<", encode_reply(5, 2500, 172, 1360, 2, robot_id, checked=checked)
    for _ in range(rng.randrange(60)):
        right, left = right + rng.randrange(60), left + rng.randrange(60)
        counts = [to_int16(right), to_int16(left), to_int16(right)][: 3 if code == OMNI else 2]
        sequence += rng.choice([0, 1, 1, 1, 1, 1, 1, 3]) if maybe(rng, 0.1) else 1
        stamp = Stamp(to_int16(sequence), to_int16(sequence * 312)) if checked else None
        sonars = [] if code == 6 else [100, 200, 300]
        yield "<", encode_reply(code, *counts, *sonars, stamp=stamp, checked=checked)
        if maybe(rng, 0.05):
            yield "<", encode_reply(41, rng.randrange(1024), checked=checked)
        if maybe(rng, 0.05):
            yield "<", rng.choice([b"hello\r\n", b"\x00\xff'", b"@8,1,2e", b"@", b"e\\", b"\r\n", b"x" * 99])
        if maybe(rng, 0.3):
            yield ">", encode_request(11, 200, rng.randrange(300), checked=checked)


def recorded(rng):
    """The lines of a recording."""
    robot_id, time_s, checked = rng.choice([1, 1, 4, 6, 21, 30000]), 0.0, False
    for _ in range(rng.randrange(1, 4)):
        entries = list(stretch(rng, robot_id, checked))
        remark = rng.choice([b"checked", b"plain", b"opened /dev/ttyX", b"phone {}", b"a user's"])
        if remark in (b"checked", b"plain"):
            checked = remark == b"checked"
            entries += list(stretch(rng, robot_id, checked))[:2]
        elif remark.startswith(b"opened"):
            checked = False
        for direction, data in [*entries, ("!", remark)]:
            cuts = sorted(rng.randrange(len(data)) for _ in range(2)) if maybe(rng, 0.2) else []
            for begin, end in zip([0, *cuts], [*cuts, len(data)]):
                time_s += rng.choice([0.0, 0.001, 0.02]) if direction != "!" else 0.0
                text = codecs.escape_encode(data[begin:end] if direction != "!" else data)[0]
                yield b"%.6f %s %s\n" % (time_s, direction.encode(), text)
                if direction == "!":
                    break


def damaged(rng, data):
    """The bytes with some changed, lost or more, and perhaps without their end."""
    share, found = rng.choice([0.0, 0.0, 0.001, 0.01]), bytearray()
    for byte in data:
        kind = rng.random() / share if share else 1.0
        if kind >= 1.0 or kind < 0.25:
            found.append(byte)
        if kind < 0.5:
            found.append(rng.choice([rng.randrange(256), *b"0 <>!@e,\\\r\n"]))
    return bytes(found[: rng.choice([len(found), rng.randrange(len(found) + 1)])])


@few
@given(seeds)
def test_a_summary_is_that_of_lines_and_frames_read_one_by_one(tmp_path_factory, rng):
    """However the recording is damaged or cut, and wherever a block of the file ends."""
    path = tmp_path_factory.mktemp("drive") / "drive.mrl"
    path.write_bytes(b"#mrl-recording 1 {}\n" + damaged(rng, b"".join(recorded(rng))))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lines, "BLOCK_BYTES", rng.choice([50, 1000, 20000, 1 << 18]))
        recording = Recording(str(path))
        found = summarise(recording)
        entries = list(recording)
    expected, (kept, skipped) = plain_recording.summary(path), plain_recording.entries(path)
    assert entries == kept
    assert set(recording.skipped) == set(sorted(skipped)[:100])
    assert found["duration_s"] == max([entry.time_s for entry in kept], default=0.0)
    pose, true_pose = found["pose"], expected.pop("pose")
    assert {key: found[key] for key in expected} == expected
    assert (pose is None) == (true_pose is None)
    if pose is not None:
        assert (pose["x_m"], pose["y_m"]) == pytest.approx((true_pose["x_m"], true_pose["y_m"]), abs=EQUAL_M)
        assert math.remainder(pose["yaw_rad"] - true_pose["yaw_rad"], math.tau) == pytest.approx(
            0, abs=EQUAL_M
        )


def test_a_damaged_digit_of_a_time_costs_its_own_line(tmp_path):
    times = [f"{i / 50:.6f}" for i in range(100)]
    times[40] = "9" + times[40][1:]
    (tmp_path / "log").write_text("#mrl-recording 1 {}\n" + "".join(f"{each} < a\n" for each in times))
    recording = Recording(str(tmp_path / "log"))
    assert len(list(recording)) == 99
    assert recording.skipped == {42: "time 9.8 is after that of most of the 7 lines behind it"}


def test_a_line_that_is_too_long_is_skipped(tmp_path):
    long = b"0.5 < " + b"a" * lines.LONGEST_LINE + b"b" * lines.BLOCK_BYTES
    (tmp_path / "log").write_bytes(b"#mrl-recording 1 {}\n0.1 < a\n" + long + b"\n0.6 < b\n")
    recording = Recording(str(tmp_path / "log"))
    assert [entry.data for entry in recording] == [b"a", b"b"]
    assert recording.skipped == {3: f"longer than {lines.LONGEST_LINE} bytes"}


# -- its parts


def wire(rng, direction, checked):
    """Frames of all kinds, and some that are wrong."""
    encode = encode_reply if direction is REPLIES else encode_request
    for _ in range(rng.randrange(40)):
        shape = rng.choice(list(direction.shapes.values()))
        args = [rng.randint(low, high) for low, high in shape.ranges[: rng.choice([shape.most, shape.least])]]
        stamped = {"stamp": Stamp(rng.randrange(9), -7)} if checked and shape.stamped else {}
        yield encode(shape.code, *args, **stamped, checked=checked or shape.guarded)
        if maybe(rng, 0.1):  # beyond the range of a field, with the right checksum
            body = b"@%d" % shape.code + b"".join(
                b",%d" % (high + 1) for _, high in shape.ranges[: shape.most]
            )
            yield body + (b",%de" % check_value(body) if checked else b"e")
        if maybe(rng, 0.1):
            yield rng.choice(
                [b"hello\r\n", b"\xff", b"\n", b"@", b"@8,1,2e", b"@8,-0,1,2,3,4e", b"@8,01,1,2,3,4e\r\n"]
                + [
                    b"@8,1,,2,3,4e\r\n",
                    b"@8,32768,1,2,3,4e\r\n",
                    b"@-8,1e",
                    b"@6,1-,2e",
                    b"@6,1,2e",
                    b"@13e",
                    b"[x] @6,1,2e@27,4e\r\n",
                ]
            )


@few
@given(seeds)
def test_frames_and_garbage_are_those_of_the_decoder(rng):
    direction, checked = rng.choice([REPLIES, REQUESTS]), maybe(rng, 0.6)
    data = damaged(rng, b"".join(wire(rng, direction, checked)))
    size = rng.choice([1, 7, 300, 1 << 20])
    arrays, single, found, expected, garbage = (
        FrameArrayDecoder(direction),
        FrameDecoder(direction),
        [],
        [],
        Counter(),
    )
    arrays.checked = single.checked = checked
    for start in range(0, len(data), size):
        if maybe(rng, 0.1):
            arrays.flush()
        for frames in arrays.feed(np.frombuffer(data[start : start + size], np.uint8)):
            found += [(start + at, frame) for at, frame in frames.frames()]
    arrays.flush()
    for at in range(len(data)):
        for event in single.feed(data[at : at + 1]):
            if isinstance(event, Frame):
                expected.append((at, event))
            else:
                garbage[event.reason] += 1
    assert sorted(found) == expected
    assert arrays.garbage == garbage


@pytest.mark.parametrize("make, robot, wheels", [(Odometry, "traxbot", 2), (OmniOdometry, "omni", 3)])
@few
@given(rng=seeds)
def test_many_readings_move_as_one_by_one(make, robot, wheels, rng):
    """With jumps that are refused, counters that wrap or restart, and times that bunch."""
    exact, count = maybe(rng, 0.5), rng.randrange(1, 60)
    counts, times, now = [rng.randrange(65536) for _ in range(wheels)], [], 0.0
    readings = []
    for _ in range(count):
        now += rng.choice([0.02, 0.02, 0.02, 0.02, 0.0, 1.0, 5.0])
        counts = [each + rng.randrange(-70, 120) for each in counts]
        if maybe(rng, 0.05):
            counts = rng.choice([[0] * wheels, [each + 3000 for each in counts]])
        jump = 9000 * maybe(rng, 0.03)
        readings.append([to_int16(each + jump) for each in counts])
        times.append(now)
    single, many = (make(load(robot).drive, 1.0, exact) for _ in range(2))
    for (right, left, *rear), time_s in zip(readings, times):
        single.update(right, left, time_s, *rear)
    cut = rng.randrange(count + 1)
    for rows in (slice(0, cut), slice(cut, count)):
        many.update_all(np.array(readings[rows]).reshape(-1, wheels), np.array(times[rows]))
    assert many.pose == pytest.approx(single.pose, abs=EQUAL_M)
    assert many.travel == single.travel
    assert vars(many.baseline) == vars(single.baseline)


def test_many_readings_turn_by_the_gyro_if_there_is_one():
    """The wheels slip on the spot; the gyro, which knows its bias, sees no turn."""
    single, many = (Odometry(load("traxbot").drive, 1.0) for _ in range(2))
    times = [1.2 + i / 50 for i in range(5)]
    counts = [[20 * i, -20 * i] for i in range(5)]
    for odometry in (single, many):
        odometry.heading = HeadingFilter()
        for i in range(60):
            odometry.heading.on_imu(i / 50, 0.0)
            odometry.update(0, 0, i / 50)
        odometry.heading.on_imu(1.24, 0.0)
    for (right, left), time_s in zip(counts, times):
        single.update(right, left, time_s)
    many.update_all(np.array(counts), np.array(times))
    assert many.pose == single.pose
    assert abs(many.pose.yaw_rad) < 0.01


def test_what_resembles_a_request_behind_text_on_its_line_is_no_frame():
    decoder = FrameArrayDecoder(REPLIES)
    decoder.checked = True
    twice = encode_reply(33, 250, checked=True).strip() * 2
    data = b"[x] " + twice + b"\r\n" + encode_reply(33, 250, checked=True)
    (found,) = decoder.feed(np.frombuffer(data, np.uint8))
    assert [frame for _, frame in found.frames()] == [Frame(33, (250,))]
    assert decoder.garbage == {"text": 3}
