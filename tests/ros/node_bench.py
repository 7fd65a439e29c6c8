"""The node `robot_node` in this process: rospy without a master, an emulated board in simulated time, and a script.

The order of its locks is checked.

def script():
    node.publish("cmd_vel", Twist(Vector3(0.1, 0.0, 0.0), Vector3()))
    yield  # one turn of the node
    assert node.driver.command

node.run(script)
"""

import contextlib
import ctypes
import inspect
import signal
import sys
from functools import partial
from types import SimpleNamespace

import rosgraph
import rospy
from dynamic_reconfigure.encoding import decode_config, encode_config
from rospy.impl.tcpros_service import convert_return_to_response
from rospy.msg import args_kwds_to_message

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.lock_order import VARIABLE
from ros1_bridge.control.commander import Commander
from ros1_bridge.node import run_node
from ros1_bridge.robot import command_topics, robot_node, zone_topics
from ros1_bridge.topics.publishers import Publishers
from sim_arduino.serve import factory

from .fake_topics import Topics

NS, NAME, PORT = "/bench/", "/bench/robot_node", "/dev/ttyACM0"
WALL_S, ROS_S = 1.7e9, 1000.0
"""Wall clock and clock of ROS when the board starts [s]."""


class Ros:
    """What a node sees of ROS: topics, services and parameters by name; `said` has level and text of each line.

    Arguments, messages, answers and parameters that rospy refuses are refused.
    """

    def __init__(self, patch, clock):
        self.clock, self.wall, self.said, self.ended, self.ends = clock, True, [], "", []
        self.topics, self.inputs, self.services, self.parameters = Topics(), {}, {}, {}
        self.graph = [{}, {}]  # nodes that publish and that subscribe by topic, as the master knows them
        self.no_master = None  # the error of a call of the master
        self.asked = 0  # times that its whole state was read
        plain = {
            **{f"log{level}": partial(self._say, level) for level in ("info", "warn", "err", "fatal")},
            **{f"log{level}_throttle": partial(self._say_seldom, level) for level in ("warn", "err")},
            "logwarn_once": partial(self._say, "once"),
            "Publisher": lambda name, kind, **options: self.topics(name.replace(NS, ""), kind, **options),
            "Subscriber": self._subscriber,
            "Service": self._service,
            "ServiceProxy": self._proxy,
            "get_param": self._get_param,
            "set_param": self.parameters.__setitem__,
            "has_param": lambda name: bool(self._keys(name)),
            "delete_param": self._delete_param,
            "init_node": lambda name, disable_signals: None,
            "get_name": lambda: NAME,
            "resolve_name": lambda name: f"{NS}{name}",
            "get_time": lambda: ROS_S + clock(),
            "on_shutdown": self.ends.append,
            "is_shutdown": lambda: bool(self.ended),
            "signal_shutdown": self.shut_down,
        }
        for name, stand_in in plain.items():
            patch.setattr(rospy, name, _called_as(getattr(rospy, name), stand_in))
        patch.setattr(rospy.rostime, "get_rostime", lambda: rospy.Time.from_sec(WALL_S + clock()))
        patch.setattr(rospy.rostime, "is_wallclock", lambda: self.wall)
        patch.setattr(rosgraph, "Master", lambda name: SimpleNamespace(getSystemState=self._state))

    def _say(self, level, text):
        self.said.append((level, text))

    def _say_seldom(self, level, period_s, text):
        self.said.append((f"{level} every {period_s:g} s", text))

    def _subscriber(self, name, kind, callback, **options):
        impl = SimpleNamespace(connections=[])
        made = SimpleNamespace(kind=kind, callback=callback, options=options, impl=impl)
        assert self.inputs.setdefault(name.replace(NS, ""), made) is made, f"{name} has a subscriber already"
        return made

    def _service(self, name, kind, handler):
        def call(*args):
            request = args_kwds_to_message(kind._request_class, args, {})
            return convert_return_to_response(handler(request), kind._response_class)

        if name in self.services:
            raise rospy.ServiceException(f"service [{name}] already registered")
        self.services[name] = SimpleNamespace(kind=kind, call=call)

    def _proxy(self, name, kind):
        def call(*args):
            if name not in self.services or self.services[name].kind is not kind:
                raise rospy.ServiceException(f"service [{name}] unavailable")
            return self.services[name].call(*args)

        return call

    def _get_param(self, name, *default):
        if name in self.parameters:
            return self.parameters[name]
        inside = {key[len(name) + 1 :]: self.parameters[key] for key in self._keys(name)}
        return inside or (default[0] if default else self.parameters[name])

    def _delete_param(self, name):
        for key in self._keys(name) or [name]:
            del self.parameters[key]

    def _keys(self, name):
        return [key for key in self.parameters if f"{key}/".startswith(f"{name}/")]

    def _state(self):
        self.asked += 1
        if self.no_master is not None:
            raise self.no_master
        return [[[f"{NS}{topic}", nodes] for topic, nodes in each.items()] for each in (*self.graph, {})]

    def shut_down(self, reason):
        self.ended = reason
        for end in self.ends:
            end()


def _called_as(real, stand_in):
    signature = inspect.signature(real)

    def call(*args, **options):
        signature.bind(*args, **options)
        return stand_in(*args, **options)

    return call


class Played(SteppedDriver):
    """A driver whose `wait` is a turn of the node; `failure` is its error, `tell` passes on an event."""

    turn = before = failure = None
    heard = ()

    def connect(self):
        self.before()
        return super().connect()

    def wait(self, timeout_s=None):
        return self.turn(timeout_s)

    def on_event(self, callback):
        self.heard = *self.heard, callback
        super().on_event(callback)

    @property
    def error(self):
        return self.failure or super().error

    def tell(self, event):
        for callback in self.heard:
            callback(event)


class Bench:
    """The node on an emulated robot; `run` returns its exit code.  Time passes in its turns, and in `sleep`."""

    def __init__(self, patch):
        self.driver, self.opened, self.handlers = None, None, {}
        self.turns, self.sleeps = [], []  # times that the node's loop waited, and that it slept [s]
        self.before, self._due = lambda: None, []  # `before` is called before the driver connects
        self.ros = Ros(patch, self.now)
        self.master, self.memory = SimpleNamespace(looks=0, words=""), []
        clock = SimpleNamespace(monotonic=self.now, time=lambda: WALL_S + self.now(), sleep=self._sleep)
        for module in (robot_node, command_topics, zone_topics):
            patch.setattr(module, "time", clock)
        patch.setattr(command_topics, "clock_s", self.now)
        own = {
            "Driver": self._driver,
            "Commander": lambda driver: Commander(driver, self.now),
            "Publishers": partial(Publishers, monotonic=self.now),
            "MasterWatch": self._watch,
            "later": self.later,
            "LOG": {level: getattr(rospy, say.__name__) for level, say in robot_node.LOG.items()},
            "gc": SimpleNamespace(
                collect=lambda: self.memory.append("collect"),
                unfreeze=lambda: self.memory.append("unfreeze"),
                get_objects=lambda: [self],
                freeze=lambda: self.memory.append("freeze"),
            ),
            "ctypes": SimpleNamespace(
                CDLL=lambda name: SimpleNamespace(madvise=self._advise),
                c_void_p=ctypes.c_void_p,
                c_size_t=ctypes.c_size_t,
            ),
        }
        for name, stand_in in own.items():
            patch.setattr(robot_node, name, stand_in)
        patch.setattr(run_node, "await_master", lambda uri, tell: None)
        patch.setattr(run_node, "get_registration_listeners", SimpleNamespace)
        patch.setattr(signal, "signal", self.handlers.__setitem__)
        patch.setenv(VARIABLE, "1")

    def now(self):
        return self.driver.now_s if self.driver else 0.0

    def _driver(self, port, robot, baud, options):
        self.opened = port, robot, baud, options
        self.driver = Played(self.emulated.engine, robot, options)
        self.driver.turn, self.driver.before = self._turn, self.before
        return self.driver

    def _watch(self, uri):
        self.master.uri = uri
        return SimpleNamespace(look=self._look)

    def _look(self):
        self.master.looks += 1
        return self.master.words

    def _advise(self, address, size, advice):
        self.memory.append((address.value, size.value, advice))

    def later(self, after_s, act, *args):
        self._due.append((self.now() + after_s, lambda: act(*args)))

    def _turn(self, timeout_s):
        self.turns.append(timeout_s)
        if self._script is None:
            self._script = iter(self._begin() or ())
        if next(self._script, self) is self:
            self.ros.shut_down("the script has ended")
        return self.sleep(timeout_s)

    def _sleep(self, seconds):
        self.sleeps.append(seconds)
        self.sleep(seconds)

    def sleep(self, seconds):
        """Let time pass; True if the driver was closed."""
        end_s = self.now() + seconds
        for due_s, act in sorted(self._due, key=lambda each: each[0]):
            if due_s <= end_s:
                self._due = [each for each in self._due if each[1] is not act]
                SteppedDriver.wait(self.driver, max(0.0, due_s - self.now()))
                act()
        return SteppedDriver.wait(self.driver, max(0.0, end_s - self.now()))

    def run(self, script=lambda: (), given=(), heard=(), **board):
        """`script` is a function, or a generator whose every `yield` is a turn of the node.

        `given`: parameters of the node; `heard`: topics with a subscriber; `board`: options of the emulator.
        """
        self.ros.topics.heard = heard
        self.emulated = factory.make(factory.Options(**board))
        self._begin, self._script = script, None
        self.ros.parameters[NAME] = {"port": PORT, **dict(given)}
        interval_s = sys.getswitchinterval()
        with contextlib.closing(self.emulated):
            try:
                return robot_node.main()
            finally:
                sys.setswitchinterval(interval_s)

    def publish(self, topic, message, node="/teleop"):
        taken = self.ros.inputs[topic]
        args_kwds_to_message(taken.kind, (message,), {})
        message._connection_header = {"callerid": node}
        taken.callback(message)

    def commands(self, message, turns=6, **source):
        """A command for each turn."""
        for _ in range(turns):
            self.publish("cmd_vel", message, **source)
            yield

    def call(self, service, *args):
        return self.ros.services[service].call(*args)

    def configure(self, group, **values):
        """As a client of dynamic_reconfigure; all values after that."""
        return dict(decode_config(self.call(f"~{group}/set_parameters", encode_config(values)).config))

    def sent(self, topic):
        return self.ros.topics[topic].sent

    def lines(self, words):
        """What was said with these words: level and text of each."""
        return [(level, text) for level, text in self.ros.said if words in text]

    def levels(self, words):
        return [level for level, _ in self.lines(words)]

    def status(self):
        """Values of the last status."""
        return {pair.key: pair.value for pair in self.sent("status")[-1].values}
