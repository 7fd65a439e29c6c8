"""The real firmware image sleeps between events; an interrupt at any cycle around its SLEEP is served at once."""

from pathlib import Path
from typing import Iterator, List

import pytest

from tests.long.bench.firmware_board import Rig, request

FIRMWARE = Path(__file__).resolve().parents[2] / "build" / "firmware"
SONARS, ENVIRONMENT, XBEE = (
    FIRMWARE / f"mrl_firmware{suffix}.elf" for suffix in ("", "_environment", "_xbee")
)
SEI_SLEEP, CLI = b"\x78\x94\x88\x95", b"\xf8\x94"
INSTRUCTIONS = 40  # more than the last check has
BYTE_CYCLES = 10 * 136  # 117647 baud
STOP_BIT_READ = 1292  # cycles from a start bit to the middle of the stop bit
READ_S = 70e-6  # two bytes at 400 kHz, and into the pass of the loop that follows
TURNAROUND_US = 1600  # of @6e, from its last byte: 1380, a pass of the loop, a read of the battery
PERIOD_MS = 20
TWO_PERIODS = 2 * PERIOD_MS * 16000  # cycles: a whole number of ticks
SWEEP = range(500, 1300)  # cycles from the byte of noise to the last check in its pass of the loop, and more
BEFORE_FRAME = 9000  # cycles from before the tick at which a frame is due to its first bit
FRAME_LATE_US = 200  # three passes of the loop
IDLE_AWAKE, STREAMING_AWAKE = 0.05, 0.12  # shares of the time


def rig_of(image: Path) -> Iterator[Rig]:
    board = Rig(image).settle()
    yield board
    board.close()


@pytest.fixture(params=[SONARS, ENVIRONMENT], ids=["sonars", "environment"])
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    """Images that sleep for milliseconds; the radio's timer wakes the other one each 104 us."""
    yield from rig_of(request.param)


@pytest.fixture
def sonar_rig() -> Iterator[Rig]:
    yield from rig_of(SONARS)


def sleep_left(rig: Rig) -> int:
    """Cycles until the next event that can wake the chip, 0 while it is awake."""
    return rig.machine.next_event_cycle - rig.machine.cycle


def step(rig: Rig) -> None:
    """Executes one instruction, or sleeps until the next event."""
    rig.machine.run_until(max(rig.machine.next_event_cycle, rig.machine.cycle + 1))


def last_check(rig: Rig) -> range:
    """Addresses from the CLI before the firmware's last check to its SLEEP."""
    ((begin, code),) = [piece for piece in rig.machine.image_flash if SEI_SLEEP in piece[1]]
    sleep = code.index(SEI_SLEEP) + 2
    return range(begin + code.rindex(CLI, 0, sleep), begin + sleep + 2)


def go_to_check(rig: Rig) -> None:
    """Sends all of a request but its last byte, and runs to the last check behind the next read of the battery.

    Nothing is due soon after it, so that a byte that is not seen waits for milliseconds.
    """
    rig.machine.run_until(rig.machine.send(b"@6") + BYTE_CYCLES)
    rig.transfers.clear()
    while not any(transfer.kind == "read" for transfer in rig.transfers):
        step(rig)
    rig.run(READ_S)
    while rig.machine.pc != last_check(rig)[0]:
        step(rig)


def turnaround_us(rig: Rig, instructions: int) -> float:
    """From the request's last byte, some instructions behind the last check's begin, to the end of the answer.

    Infinite if there is none in 60 ms.
    """
    go_to_check(rig)
    rig.replies()
    for _ in range(instructions):
        rig.machine.run_until(rig.machine.cycle + 1)
    at = rig.machine.cycle
    rig.machine.send(b"e", at - STOP_BIT_READ + 1)
    rig.run(60e-3)
    answers = [reply.end_cycle for reply in rig.replies() if b"@6," in reply.line]
    return rig.microseconds(answers[0] - at) if answers else float("inf")


def test_a_byte_at_any_instruction_of_the_last_check_is_answered_at_once(rig):
    turnarounds = {at: turnaround_us(rig, at) for at in range(INSTRUCTIONS)}
    assert max(turnarounds.values()) <= TURNAROUND_US, turnarounds


def frame_starts(rig: Rig) -> List[int]:
    """Cycles at which the stream's frames that have come since the last call began."""
    return [reply.start_cycle for reply in rig.replies() if b"@8," in reply.line]


def wakes(rig: Rig, until: int) -> List[int]:
    """Cycles at which the chip is woken until then."""
    seen = []
    while rig.machine.cycle < until:
        if sleep_left(rig):
            seen.append(rig.machine.next_event_cycle)
        step(rig)
    return seen


def delays_us(rig: Rig, which: int) -> List[float]:
    """How late the frames of a stream begin if a pass of the loop ends at each cycle around one of their events.

    Args:
        which: the event, in the order of the events that wake the chip for a frame: 0 is the alarm, -1 the end of the
            counters' read.
    """
    rig.machine.run_until(rig.machine.send(request("start_stream", PERIOD_MS)) + 3 * TWO_PERIODS)
    place = min(frame_starts(rig)[-2:]) + TWO_PERIODS
    rig.machine.run_until(place - BEFORE_FRAME)
    event = [cycle for cycle in wakes(rig, place) if cycle < place][which]
    delays = []
    for offset in SWEEP:
        place, event = place + TWO_PERIODS, event + TWO_PERIODS
        rig.machine.send(b"x", event - offset - STOP_BIT_READ)
        rig.machine.run_until(place + TWO_PERIODS // 4)
        delays.append(rig.microseconds(frame_starts(rig)[-1] - place))
    return delays


@pytest.mark.parametrize("event", [0, -1], ids=["alarm", "end of a read"])
def test_an_event_of_the_chip_at_any_cycle_of_a_pass_is_in_time(sonar_rig, event):
    """A byte of noise makes the loop look around and decide to sleep just then."""
    delays = delays_us(sonar_rig, event)
    assert max(delays) <= FRAME_LATE_US, delays


def awake_share(rig: Rig, seconds: float) -> float:
    """Share of the cycles in which the CPU is awake."""
    begun, awake = rig.machine.cycle, rig.machine.awake_cycles
    rig.run(seconds)
    return (rig.machine.awake_cycles - awake) / (rig.machine.cycle - begun)


def test_an_idle_board_sleeps(rig):
    assert awake_share(rig, 2.0) <= IDLE_AWAKE


def test_a_streaming_board_sleeps(rig):
    """50 frames a second."""
    rig.machine.send(request("start_stream", PERIOD_MS))
    rig.run(0.1)
    assert awake_share(rig, 2.0) <= STREAMING_AWAKE


def test_a_sleeping_board_is_not_reset(sonar_rig):
    sonar_rig.motors.present = False
    before = sonar_rig.machine.resets
    sonar_rig.run(3.0)
    assert sonar_rig.machine.resets == before
