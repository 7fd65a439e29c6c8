"""The image at 500000 baud on the simulated chip: rate of the stream, and how soon commands are carried out."""

import pytest

from tests.bench.firmware_board import Rig, request
from tests.bench.firmware_measures import MOVE, STOP, command_delays_us, stream_of
from tests.conformance.bench import FIRMWARE

BAUD, ROW = 500000, 2
RATE_HZ, COMMAND_US = 1000.0, 700.0
FRAME_BYTES = 27


@pytest.fixture(scope="module")
def rig():
    """A board that streams at full rate."""
    rig = Rig(FIRMWARE).settle()
    rig.machine.send(request("set_baud", ROW))
    rig.run(0.01)
    rig.machine.set_host_baud(BAUD)
    rig.machine.send(request("start_stream"))
    yield rig
    rig.close()


def test_the_line_is_exact(rig):
    assert rig.machine.baud == BAUD


def test_the_stream_reaches_a_thousand_frames_a_second(rig):
    frames = stream_of(rig, 0.3)
    assert {len(frame.line) for frame in frames} == {FRAME_BYTES}
    seconds = (frames[-1].end_cycle - frames[0].end_cycle) / rig.machine.frequency_hz
    assert (len(frames) - 1) / seconds >= RATE_HZ


@pytest.mark.parametrize(("command", "code"), [(b"@11,500,-800e", MOVE), (b"@13e", STOP)])
def test_commands_are_carried_out_in_time(rig, command, code):
    assert max(command_delays_us(rig, command, code, 60)) <= COMMAND_US
