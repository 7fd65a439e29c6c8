"""No single damaged byte of a request turns motors: each request of a greeting and of a drive, each fault of each byte.

Boards of 2013 have no checksum; what is left of their hazards is listed here, and in docs/hazards.md.
"""

import re
from collections import Counter

import pytest

from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder, encode_request
from mrl_driver.protocol.table import BY_CODE, COMMANDS
from mrl_driver.robot.models import load
from sim_arduino.board.board2013 import AUGUST_S, DIGITS, Board2013
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve.factory import Options
from sim_arduino.world.world import World
from tests.firmware.twin import TwinDecoder
from tests.neighbours import SPEEDS as SPEEDS_SENT
from tests.neighbours import faults, sent

OURS = {
    "OMNI-3MD": Options(robot="traxbot"),
    "three wheels": Options(robot="omni"),
    "H-bridge": Options(robot="duo"),
    "sensors": Options(robot="traxbot", environment=True),
}
OF_2013 = {
    "August": Options(robot="traxbot", profile="2013-august"),
    "August with sensors": Options(robot="traxbot", profile="2013-august", environment=True),
    "January": Options(robot="traxbot", profile="2013-january"),
}
NEXT = b"@30e"  # What follows on the line; nothing may follow as well
DECODERS = {"python": lambda checked: FrameDecoder(REQUESTS, checked), "firmware": TwinDecoder}


def turning(decoder, wire):
    """The requests that turn motors in these bytes, and in these with another request behind them."""
    found = []
    for rest in (b"", NEXT):
        events = decoder().feed(wire + rest)
        found += [each for each in events if isinstance(each, Frame) and BY_CODE[each.code].turns]
    return found


# -- boards with our firmware


@pytest.mark.parametrize("decoder", DECODERS)
@pytest.mark.parametrize("check", [True, False])
@pytest.mark.parametrize("board", OURS)
def test_a_fault_of_a_greeting_is_no_motor_command(board, check, decoder):
    for wire in sent(OURS[board], check).greeting:
        for fault in faults(wire):
            for checked in (False, True):
                assert not turning(lambda c=checked: DECODERS[decoder](c), fault.wire), fault


@pytest.mark.parametrize("decoder", DECODERS)
def test_a_fault_of_any_request_that_turns_no_motor_is_no_motor_command(decoder):
    """Such as what a program asks for, or the change of the baud rate."""
    rows = [row for row in COMMANDS if not row.turns and row.name != "xbee_text"]
    for row in rows:
        for value in (row.request and (-32768, 20, 32767)) or (0,):
            wire = encode_request(row.code, *(max(f.low, min(f.high, value)) for f in row.request))
            for fault in faults(wire):
                assert not turning(lambda: DECODERS[decoder](False), fault.wire), fault


@pytest.mark.parametrize("decoder", DECODERS)
@pytest.mark.parametrize("board", OURS)
def test_a_fault_of_a_drive_with_checksums_is_no_other_motor_command(board, decoder):
    for wire in sent(OURS[board]).drive:
        usual = turning(lambda: DECODERS[decoder](True), wire)
        for fault in faults(wire):
            assert turning(lambda: DECODERS[decoder](True), fault.wire) in ([], usual), fault


def test_a_fault_of_a_drive_without_checksums_is_a_move_or_one_in_percent():
    """One bit makes 10 of 11.  A stop, and what is asked beside it, becomes none."""
    became = {
        (BY_CODE[int(wire[1 : wire.find(b",")])].name if b"," in wire else wire, BY_CODE[found.code].name)
        for wire in sent(OURS["OMNI-3MD"], check=False).drive
        for fault in faults(wire)
        for found in turning(lambda: FrameDecoder(REQUESTS), fault.wire)
    }
    assert became == {("move_differential", "move_differential"), ("move_differential", "move_motors")}


# -- boards of 2013

CALIBRATE, PID, PERCENT, SPEEDS, POSITION = 0xFB, 0xF8, 0xF7, 0xEB, 0xEE
"""Registers of the motor board: what the requests 1, 9, 10, 11, 12 write."""
TURNING = (CALIBRATE, PID, PERCENT, SPEEDS, POSITION)
OVERRUN = -1
HANGING = {22, 23, 25, 27}  # Requests at which a board without their sensors waits forever
BODY = re.compile(rb"@([^@e]*)e")
OTHER_SPEEDS = {"lost": 7, "doubled": 7, "swapped": 6, "bit": 51}  # Faults of `MOVE` by kind
STARTED_S = AUGUST_S + 0.05
DONE_S = 0.15


class Parser:
    """A board of 2013 with all sensors that is reset for each piece of bytes."""

    def __init__(self, january):
        self.plant = Plant(load("traxbot"), World(), (0.0, 0.0, 0.0), sonars=False)
        self.board = Board2013(self.plant, january)

    def motor_commands(self, wire):
        """What turns motors: registers and values; `OVERRUN` is a number that overruns a buffer of the board."""
        board = self.board
        board.reset()
        board.advance(board.now_s + STARTED_S)
        commands = self.plant.motor_board.commands
        commands.clear()
        board.receive(wire)
        self.answers = board.advance(board.now_s + DONE_S)
        turned = [(each.code, each.values) for each in commands if each.code in TURNING]
        numbers = [number for frame in BODY.findall(wire) for number in frame.split(b",")]
        return turned + [(OVERRUN, ())] * any(len(number) > DIGITS for number in numbers)

    def hangs_at(self):
        """The code of an answer to the last bytes that boards without sensors do not give."""
        return {code for code in HANGING if b"@%d," % code in self.answers}


@pytest.fixture(params=[False, True], ids=["August", "January"])
def parser(request):
    return Parser(request.param)


def outcomes(parser, requests, rest=b""):
    """Each fault that makes another motor command: request, kind, place, register."""
    return [
        (wire, fault.kind, fault.place, found[0])
        for wire in requests
        for usual in [parser.motor_commands(wire)]
        for fault in faults(wire)
        for found in parser.motor_commands(fault.wire + rest)
        if found not in usual
    ]


@pytest.mark.parametrize("board", OF_2013)
def test_a_fault_of_a_greeting_is_no_motor_command_of_2013(board, parser):
    """With another one behind it, which ends what the fault has left open."""
    assert outcomes(parser, sent(OF_2013[board]).greeting, b"@29e") == []


@pytest.mark.parametrize("board", OF_2013)
def test_a_fault_of_another_request_than_a_move_is_no_motor_command_of_2013(board, parser):
    others = [wire for wire in sent(OF_2013[board]).drive if not wire.startswith(b"@65547,")]
    assert b"@65549e" in others and outcomes(parser, others) == []


MOVE = b"@65547,200,-100e"
FIRST_COMMA, SECOND_COMMA = 6, 10


def test_a_fault_of_a_move_to_a_board_of_2013_is_never_calibrate(parser):
    moves = [wire for wire in sent(OF_2013["August"]).drive if wire.startswith(b"@65547,")]
    assert len(moves) == sum(map(any, SPEEDS_SENT)) and CALIBRATE not in {
        each[3] for each in outcomes(parser, moves)
    }


def test_what_is_left_of_a_move_to_a_board_of_2013(parser):
    """Its 16 bytes have 172 faults; the figures are in docs/hazards.md.

    Two bits of the last digit make 10 or 9 of 11: the speeds in mm/s and mrad/s are taken as percent.  Faults of the
    commas overrun a buffer; with the parser of its source on a simulated chip, the board then restarts, which stops
    the motors.
    """
    found = [each[1:] for each in outcomes(parser, [MOVE])]
    left = [each for each in found if each[2] not in (SPEEDS, OVERRUN)]
    assert left == [("bit 0", 5, PERCENT), ("bit 1", 5, PID)]
    bits = {(f"bit {bit}", place) for place in (FIRST_COMMA, SECOND_COMMA) for bit in range(8)}
    assert {each[:2] for each in found if each[2] == OVERRUN} == {*bits, ("lost", FIRST_COMMA)}
    kinds = Counter(each[0].split()[0] for each in found if each[2] == SPEEDS)
    assert (sum(1 for _ in faults(MOVE)), kinds) == (172, OTHER_SPEEDS)


def test_what_makes_a_board_of_2013_hang_that_lacks_the_sensors():
    """One bit each."""
    parser, found = Parser(january=False), set()
    for wire in (*sent(OF_2013["August"]).greeting, *sent(OF_2013["August"]).drive):
        for fault in faults(wire):
            parser.motor_commands(fault.wire)
            found |= {(wire, code) for code in parser.hangs_at()}
    assert found == {(b"@65541e", 25), (b"@65549e", 23)}


def test_of_the_plain_requests_of_2013_many_faults_are_calibrate(parser):
    """The control: why the codes are wrapped."""
    plain = [b"@5e", b"@13e", b"@18e", b"@19e", b"@11,200,-100e"]
    found = Counter(each[0] for each in outcomes(parser, plain) if each[3] == CALIBRATE)
    assert [found[wire] for wire in plain] == [1, 7, 8, 8, 9]
