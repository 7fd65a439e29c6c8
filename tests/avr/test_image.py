"""The real firmware image on the chip: faults that only the hardware has, and input that it must refuse."""

from pathlib import Path
from typing import Iterator, List

import pytest

from mrl_driver.protocol import REPLIES, Frame, FrameDecoder
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import FAULTS, REASONS, RESET_CAUSES
from tests.long.bench.firmware_board import Rig

ELF = Path(__file__).resolve().parents[2] / "build" / "firmware" / "mrl_firmware.elf"
MOVE, STOP = 0xEB, 0xFC
ENDLESS_LOOP = b"\xff\xcf"  # rjmp to itself
BLOCKED_S = 25e-3  # longest pause in serving the wire when I2C hangs
READY_S = 0.12  # boot, and the motor board asked and set up


@pytest.fixture
def rig() -> Iterator[Rig]:
    board = Rig(ELF)
    board.run(READY_S)
    yield board
    board.close()


def answers(rig: Rig, asked: bytes, within_s: float = 20e-3) -> List[Frame]:
    rig.replies()
    rig.machine.run_until(rig.machine.send(asked))
    rig.run(within_s)
    received = b"".join(reply.line for reply in rig.replies())
    return [event for event in FrameDecoder(REPLIES).feed(received) if isinstance(event, Frame)]


def status(rig: Rig) -> dict:
    """The answer to read_status by field, faults and causes by name."""
    ((_, (_, _, cause, reason, faults, clamped), _),) = answers(rig, b"@30e")
    return {
        "reset_cause": RESET_CAUSES[cause],
        "stop_reason": STOP_REASONS[reason],
        "faults": {name for bit, (name, _) in enumerate(FAULTS) if faults >> bit & 1},
        "clamped": clamped,
    }


def refused(rig: Rig) -> dict:
    """How much was refused so far, by reason, zeros left out."""
    ((_, counts, _),) = answers(rig, b"@31e")
    return {row.name: count for row, count in zip(REASONS, counts) if count}


def drive(rig: Rig) -> None:
    answers(rig, b"@11,300,0e")
    rig.forget()


@pytest.mark.parametrize("line", ["sda", "scl"])
def test_a_hanging_bus_is_reported(rig, line):
    rig.machine.hang_bus(line)
    rig.run(0.3)
    assert "bus_hung" in status(rig)["faults"]


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
    assert answers(rig, b"@6e") == [Frame(6, (1234, -567))]


def lock_up(rig: Rig, longest_s: float = 2.0) -> float:
    """Makes the program loop where it can be interrupted next; the time until it was mended or reset [s]."""
    machine = rig.machine
    while not machine.interrupts_on:
        rig.run(1e-6)
    at = machine.pc
    code = dict(machine.image_flash)
    begun, resets = machine.time_s, machine.resets
    machine.patch(at, ENDLESS_LOOP)
    while machine.resets == resets and machine.time_s < begun + longest_s:
        rig.run(1e-3)
    for address, data in code.items():
        machine.patch(address, data)
    return machine.time_s - begun


def test_a_lock_up_ends_in_a_reset_within_half_a_second(rig):
    drive(rig)
    assert lock_up(rig) < 0.5


@pytest.mark.parametrize("flags", [0, None])
def test_a_lock_up_is_told_as_such(rig, flags):
    rig.machine.set_reset_flags(flags)
    lock_up(rig)
    rig.run(READY_S)
    assert status(rig)["reset_cause"] == "watchdog"


def test_after_a_lock_up_the_motors_are_stopped(rig):
    drive(rig)
    lock_up(rig)
    rig.forget()
    rig.run(READY_S)
    assert rig.transfers[0].data[0] == STOP


@pytest.mark.parametrize("restart, cause", [("reset", "external"), ("power_cycle", "power_on")])
@pytest.mark.parametrize("flags", [0, None])
def test_other_resets_are_told_apart(rig, restart, cause, flags):
    rig.machine.set_reset_flags(flags)
    getattr(rig.machine, restart)()
    rig.run(READY_S)
    assert status(rig)["reset_cause"] == cause


def test_commands_that_waited_through_a_stall_are_not_carried_out(rig):
    """Wherever the loop stood still for 300 ms, interrupts going on; the one behind the stall is carried out."""
    for phase in range(4):
        drive(rig)
        rig.run(phase * 23e-6)
        resets = rig.machine.resets
        rig.machine.send(b"@11,400,0e")
        lock_up(rig, 0.3)
        rig.run(0.1)
        told = [one.data[0] for one in rig.transfers if one.kind == "write" and one.data[0] in (MOVE, STOP)]
        assert told[-1] == STOP and rig.machine.resets == resets
        rig.forget()
        answers(rig, b"@11,200,0e")
        assert [write.data for write in rig.writes(MOVE)] == [b"\xeb\x00\xc8\x00\x00"]


BAD = {
    b"@11,+5,0e": "not_integer",
    b"@11, 5,0e": "not_integer",
    b"@11,1x,0e": "not_integer",
    b"@11,0x10,0e": "not_integer",
    b"@11,-,0e": "not_integer",
    b"@11,--5,0e": "not_integer",
    b"@11,007,0e": "not_integer",
    b"@11,,0e": "not_integer",
    b"@11,32768,0e": "beyond_int16",
    b"@99e": "unknown_command",
    b"@0e": "unknown_command",
    b"@11,5e": "argument_count",
    b"@11,5,0,1e": "argument_count",
    b"@9,1,40,1,40e": "argument_count",
    b"@9,101,0e": "argument_range",
    b"@3,4,0e": "argument_range",
    b"@33,250e": "bad_check",
    b"@37e": "bad_check",
    b"@" + b"1" * 300 + b"e": "too_long",
}


@pytest.mark.parametrize("frame", BAD, ids=[frame[:20].decode() for frame in BAD])
def test_bad_input_is_refused_counted_and_without_effect(rig, frame):
    """That reason alone (what is left of too long a frame is noise); the motors hear nothing; all goes on."""
    before = len(rig.motors.commands)
    answers(rig, frame)
    assert (set(refused(rig)) - {"noise"}, len(rig.motors.commands)) == ({BAD[frame]}, before)


def test_probes_of_a_modem_manager_do_nothing(rig):
    before = len(rig.motors.commands)
    answers(rig, b"AT\r\n+++\r\nATZ\r\n")
    assert len(rig.motors.commands) == before


def test_a_flood_of_garbage_does_not_stop_the_stream(rig):
    """Line rate of zeros, ones and letters: frames keep coming every 20 ms."""
    answers(rig, b"@18,20e")
    rig.machine.send(bytes(range(256)) * 10)
    rig.replies()
    rig.run(0.2)
    assert 9 <= len(rig.replies()) <= 11


@pytest.mark.parametrize("volts", [0.0, 5.0])
def test_a_missing_or_saturated_sonar_has_no_reading(rig, volts):
    rig.run(0.5)
    rig.machine.adc_volts = lambda channel, time_s: volts
    rig.run(1.0)
    (frame,) = answers(rig, b"@7e")
    assert frame.args == (-1, -1, -1)
