"""The real firmware image on the chip: faults that only the hardware has."""

from pathlib import Path
from typing import Iterator

import pytest

from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import RESET_CAUSES
from tests.long.bench.firmware_board import Rig, lock_up

ELF = Path(__file__).resolve().parents[2] / "build" / "firmware" / "mrl_firmware.elf"
MOVE, STOP = 0xEB, 0xFC
BLOCKED_S = 25e-3  # longest pause in serving the wire when I2C hangs
READY_S = 0.12  # boot, and the motor board asked and set up


@pytest.fixture
def rig() -> Iterator[Rig]:
    board = Rig(ELF)
    board.run(READY_S)
    yield board
    board.close()


def drive(rig: Rig) -> None:
    rig.say(b"@11,300,0e")
    rig.forget()


@pytest.mark.parametrize("line", ["sda", "scl"])
def test_a_hanging_bus_is_reported(rig, line):
    rig.machine.hang_bus(line)
    rig.run(0.3)
    assert "bus_hung" in rig.faults


@pytest.mark.parametrize("line", ["sda", "scl"])
def test_a_hanging_bus_holds_up_no_answer_for_long(rig, line):
    """Requests that need no bus, one each 4 ms, are answered within 25 ms."""
    rig.machine.hang_bus(line)
    rig.replies()
    asked = []
    for _ in range(100):
        asked.append(rig.machine.send(b"@17e"))
        rig.run(4e-3)
    rig.run(BLOCKED_S)
    received = [reply.end_cycle for reply in rig.replies()]
    assert len(received) == len(asked)
    assert max(b - a for a, b in zip(asked, received)) <= BLOCKED_S * rig.machine.frequency_hz


def test_a_slave_that_holds_sda_is_clocked_out(rig):
    rig.machine.hang_bus("sda", release_clocks=8)
    rig.run(0.3)
    assert rig.say(b"@6e") == [Frame(6, (1234, -567))]


@pytest.mark.parametrize("flags", [0, None])
def test_a_lock_up_is_told_as_such(rig, flags):
    rig.machine.set_reset_flags(flags)
    lock_up(rig.machine)
    rig.run(READY_S)
    assert RESET_CAUSES[rig.status()["reset_cause"]] == "watchdog"


def test_a_lock_up_ends_in_a_reset_within_half_a_second_and_a_stop(rig):
    drive(rig)
    assert lock_up(rig.machine) < 0.5
    rig.forget()
    rig.run(READY_S)
    assert rig.transfers[0].data[0] == STOP


@pytest.mark.parametrize("restart, cause", [("reset", "external"), ("power_cycle", "power_on")])
@pytest.mark.parametrize("flags", [0, None])
def test_other_resets_are_told_apart(rig, restart, cause, flags):
    rig.machine.set_reset_flags(flags)
    getattr(rig.machine, restart)()
    rig.run(READY_S)
    assert RESET_CAUSES[rig.status()["reset_cause"]] == cause


def test_commands_that_waited_through_a_stall_are_not_carried_out(rig):
    """Wherever the loop stood still for 300 ms, interrupts going on; the one behind the stall is carried out."""
    for phase in range(4):
        drive(rig)
        rig.run(phase * 23e-6)
        resets = rig.machine.resets
        rig.machine.send(b"@11,400,0e")
        lock_up(rig.machine, 0.3)
        rig.run(0.1)
        told = [one.data[0] for one in rig.transfers if one.kind == "write" and one.data[0] in (MOVE, STOP)]
        assert told[-1] == STOP and rig.machine.resets == resets
        rig.forget()
        rig.say(b"@11,200,0e")
        assert [write.data for write in rig.writes(MOVE)] == [b"\xeb\x00\xc8\x00\x00"]


def test_a_flood_of_garbage_does_not_stop_the_stream(rig):
    """Line rate of zeros, ones and letters: frames keep coming every 20 ms."""
    rig.say(b"@18,20e")
    rig.machine.send(bytes(range(256)) * 10)
    rig.replies()
    rig.run(0.2)
    assert 9 <= len(rig.replies()) <= 11


@pytest.mark.parametrize("volts", [0.0, 5.0])
def test_a_missing_or_saturated_sonar_has_no_reading(rig, volts):
    rig.run(0.5)
    rig.machine.adc_volts = lambda channel, time_s: volts
    rig.run(1.0)
    (frame,) = rig.say(b"@7e")
    assert frame.args == (-1, -1, -1)
