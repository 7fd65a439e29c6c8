"""One robot holds another one by radio, from driver to driver over emulated boards, in simulated time."""

import pytest

from mrl_driver.cli.commands.radio import free_others, hold_others
from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout
from mrl_driver.navigation.radio_holder import RadioHolder
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from sim_arduino.serve import factory
from sim_arduino.world.world import World

ONE, TWO = 0x0013A20040000001, 0x0013A20040000002
WRITE, HOLD = BY_NAME["write_config"].code, PARAMETER_BY_NAME["radio_hold"].number
SILENT = 20
SPEED_M_S = 0.2
LASTING = Options(command_timeout_s=None)


class Pair:
    """Robot `one` holds; robot `two` drives beside it in time."""

    def __init__(self):
        world = World()
        self.made = [
            factory.make(factory.Options(name=name, pose=pose, radio=f"{address:x}"), world)
            for name, pose, address in (("one", "0,0,0", ONE), ("two", "0,1,0", TWO))
        ]
        self.one, self.two = (SteppedDriver(each.engine, "traxbot", LASTING) for each in self.made)
        self.one.connect()
        self.two.connect()
        self.holder = RadioHolder([TWO])
        self.one.radio.on_text(lambda text: self.holder.receive(text, self.one.now_s))
        self.one.on_telemetry(lambda _: self.two.wait(max(0.0, self.one.now_s - self.two.now_s)))

    @property
    def moves(self):
        """Whether robot `two` moves half a second later."""
        self.one.wait(0.5)
        return abs(self.two.twist.linear_m_s) > 0.01

    def close(self):
        for each in (self.two, self.one, *self.made):
            each.close()


@pytest.fixture
def pair():
    made = Pair()
    yield made
    made.close()


def test_held_robot_stops_refuses_and_stands_after_it_is_free(pair, capsys):
    pair.two.ask(WRITE, HOLD, SILENT)
    pair.one.wait(2.5)  # after its start, a board listens for holders
    pair.two.drive(SPEED_M_S, 0.0)
    assert pair.moves
    hold_others(pair.one, pair.holder, 1.0)
    assert capsys.readouterr().out == "no answer from 0013a20040000002\nall are held\n"
    assert not pair.moves
    pair.two.drive(SPEED_M_S, 0.0)
    assert not pair.moves
    pair.two.stop()
    free_others(pair.one, pair.holder)
    assert not pair.moves
    pair.two.drive(SPEED_M_S, 0.0)
    assert pair.moves


def test_robot_that_does_not_allow_a_hold_drives_on_and_is_named(pair, capsys):
    pair.two.drive(SPEED_M_S, 0.0)
    hold_others(pair.one, pair.holder, 1.0)
    assert pair.moves and capsys.readouterr().out == "no answer from 0013a20040000002\n"
    with pytest.raises(BoardTimeout, match="no answer from 0013a20040000002: it may still be held"):
        free_others(pair.one, pair.holder)
