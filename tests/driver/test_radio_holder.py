"""The holder's side of a hold by radio, with the emulated board's side; each text arrives unless the air is cut."""

import pytest

from mrl_driver.errors import ConfigError
from mrl_driver.navigation.radio_holder import REPEAT_S, RadioHolder
from mrl_driver.protocol.hold_text import HoldText
from mrl_driver.robot.radio import BROADCAST, RadioText
from sim_arduino.board.radio_hold import RadioHold

OWN, ONE, TWO = 0x0013A20040000000, 0x0013A20040000001, 0x0013A20040000002
SILENT = 20  # Parameter `radio_hold` [100 ms]


class Air:
    """A holder and two boards; `cut` has the addresses of boards out of range."""

    def __init__(self):
        self.now_s = 10.0
        self.boards = {address: self.board() for address in (ONE, TWO)}
        self.cut = set()
        self.holder = RadioHolder([ONE, TWO])

    def board(self, started_s=0.0):
        made = RadioHold({"radio_hold": SILENT}, lambda: None, started_s)
        made.run(self.now_s)
        return made

    def exchange(self, times=3):
        for _ in range(times):
            self.now_s += REPEAT_S
            for address, data in self.holder.texts(self.now_s):
                if address not in self.cut:
                    self.boards[address].receive(OWN, data, self.now_s)
                    for _, answer in self.boards[address].answers():
                        self.holder.receive(RadioText(address, answer), self.now_s)

    @property
    def held(self):
        return {address for address, board in self.boards.items() if board.held}

    @property
    def holds_all(self):
        return self.holder.holds_all(self.now_s)


@pytest.fixture
def air():
    return Air()


def test_holder_knows_that_all_are_held(air):
    air.holder.hold()
    assert not air.holds_all
    air.exchange(1)
    assert air.holds_all and air.held == {ONE, TWO}


def test_robot_that_does_not_answer_is_named_and_not_counted_as_held(air):
    air.cut.add(TWO)
    air.holder.hold()
    air.exchange(10)
    assert not air.holds_all and air.holder.unanswered(air.now_s) == (TWO,)


def test_freed_robots_are_not_held(air):
    air.holder.hold()
    air.exchange()
    air.holder.free()
    assert not air.holds_all and not air.holder.all_freed
    air.exchange(1)
    assert air.holder.all_freed and not air.held and not air.holds_all


def test_robot_that_does_not_hear_the_end_stays_held_and_is_named(air):
    air.holder.hold()
    air.exchange()
    air.cut.add(ONE)
    air.holder.free()
    air.exchange()
    assert air.held == {ONE} and air.holder.unfreed == (ONE,)


def test_answer_of_the_last_hold_does_not_count_for_the_next_one(air):
    air.holder.hold()
    air.exchange()
    air.holder.free()
    air.exchange()
    air.holder.hold()
    for address in (ONE, TWO):
        air.holder.receive(RadioText(address, HoldText("held", 1).data), air.now_s)
    assert not air.holds_all
    air.exchange(1)
    assert air.holds_all and air.held == {ONE, TWO}


@pytest.mark.parametrize("freed", [False, True])
def test_holder_that_has_started_again_uses_a_larger_number(air, freed):
    for _ in range(3):
        air.holder.free()
        air.holder.hold()
        air.exchange()
    if freed:
        air.holder.free()
        air.exchange()
    air.holder = RadioHolder([ONE, TWO])
    air.holder.hold()
    air.exchange()
    assert air.holds_all and air.held == {ONE, TWO}


def test_board_that_has_started_again_is_held_again(air):
    air.holder.hold()
    air.exchange()
    air.boards[ONE] = air.board(started_s=air.now_s)
    air.exchange(1)
    assert air.holds_all and air.held == {ONE, TWO}


@pytest.mark.parametrize("data", [b"hello", HoldText("hold", 1).data, HoldText("held", 1).data])
def test_texts_of_others_are_no_answers(air, data):
    air.holder.hold()
    air.exchange(0)
    air.holder.receive(RadioText(OWN, data), air.now_s)
    assert set(air.holder.unanswered(air.now_s)) == {ONE, TWO}


@pytest.mark.parametrize("addresses", [[], [ONE, ONE], list(range(1, 10)), [BROADCAST]])
def test_wrong_addresses_are_refused(addresses):
    with pytest.raises(ConfigError, match="expected 1 to 8|cannot be held"):
        RadioHolder(addresses)
