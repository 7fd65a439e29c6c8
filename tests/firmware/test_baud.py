"""The image at 500000 baud on the simulated chip: rate of the stream, and how soon commands are carried out."""

import pytest

from tests.conformance.bench import FIRMWARE
from tests.long.bench.firmware_board import Rig, request
from tests.long.bench.firmware_measures import MOVE, STOP, command_delays_us, stream_of

BAUD, ROW = 500000, 2
RATE_HZ, COMMAND_US = 1000.0, 700.0
FRAME_BYTES = 27
FED_S = 0.1  # The shortest timeout that the motor board can have [s]


@pytest.fixture(scope="module")
def rig():
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


@pytest.fixture
def fastest():
    """A board whose line runs at 1000000 baud, where a byte comes as soon as the one before it is decoded."""
    rig = Rig(FIRMWARE).settle()
    rig.machine.send(request("set_baud", 3))
    rig.run(0.01)
    rig.machine.set_host_baud(1000000)
    yield rig
    rig.close()


@pytest.mark.parametrize("piece", [b"@13e", b"@11,300,0e", b"@99e", b"@", b"1"])
def test_a_flood_keeps_nothing_from_the_motor_board(fastest, piece):
    """Half a second of it: the chip is not reset, and the traffic that feeds the motor board's timeout goes on."""
    machine, transfers = fastest.machine, []
    machine.on_transfer = lambda transfer: transfers.append(transfer.cycle)
    resets, began = machine.resets, machine.cycle
    machine.run_until(machine.send(piece * (50000 // len(piece))))
    cycles = [began, *transfers, machine.cycle]
    longest_s = max(later - earlier for earlier, later in zip(cycles, cycles[1:])) / machine.frequency_hz
    assert machine.resets == resets and longest_s < FED_S
