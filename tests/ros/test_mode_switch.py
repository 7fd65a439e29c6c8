"""What a change of the operation mode does and announces."""

from types import SimpleNamespace

import pytest

from mrl_driver.errors import LinkLost
from mrl_driver.robot.models import Limits
from ros1_bridge.robot.mode_switch import ModeSwitch

from .fake_topics import Topics


class Bench:
    """A switch, its topics, the parameters that it sets, and the modes that the commander was given."""

    def __init__(self, lost=False, master=True):
        self.topics, self.parameters, self.modes = Topics(), {}, []
        self._lost, self._master = lost, master
        self.commander = SimpleNamespace(
            manual=False, set_manual=self._take, in_force=Limits(0.15, 0.5, 0.2, 1.0)
        )
        self.ros = SimpleNamespace(Publisher=self.topics, set_param=self._set, ROSException=ValueError)
        self.switch = ModeSwitch(self.commander, self.ros)

    def _take(self, manual):
        changes, self.commander.manual = manual != self.commander.manual, manual
        self.modes.append(manual)
        if self._lost:
            raise LinkLost("gone")
        return changes

    def _set(self, name, value):
        if not self._master:
            raise ConnectionRefusedError("no master")
        self.parameters[name] = value


def test_mode_is_published_from_the_start_and_kept_for_a_respawn():
    bench = Bench()
    assert bench.switch.set(True) == (
        True,
        "manual mode: at most 0.15 m/s and 0.5 rad/s; goals are cancelled",
    )
    out = bench.topics["manual_mode"]
    assert out.sent == [False, True] and out.options["latch"]
    assert (bench.parameters, bench.modes) == ({"~operation_mode": "manual"}, [True])


@pytest.mark.parametrize("fault, success", [({"lost": True}, False), ({"master": False}, True)])
def test_mode_is_taken_and_told_whatever_fails(fault, success):
    bench = Bench(**fault)
    done, text = bench.switch.set(True)
    assert (done, bench.modes, bench.topics["manual_mode"].sent[-1]) == (success, [True], True)
    assert success or "the robot cannot be reached: gone" in text


@pytest.mark.parametrize("tell", ["publish", "set_param"])
def test_change_by_another_thread_meanwhile_has_the_last_word(tell):
    """The other change comes between the moment when the first one decides what to tell, and its telling."""
    bench, interrupted = Bench(), []
    place = bench.topics["manual_mode"] if tell == "publish" else bench.ros
    last = getattr(place, tell)

    def told(*args):
        if not interrupted:
            interrupted.append(True)
            bench.switch.set(False)
        last(*args)

    setattr(place, tell, told)
    bench.switch.set(True)
    assert interrupted and not bench.commander.manual
    assert bench.topics["manual_mode"].sent[-1] is False
    assert bench.parameters == {"~operation_mode": "automatic"}
