"""A robot for the server's tests: it notes what it is told, and reports what a test sets."""

import math

from mrl_driver.apps.web.robot import Recorded
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import load
from mrl_driver.robot.odometry import Twist
from mrl_driver.view.shown_state import Row, Shown


class FakeRecordings:
    """Their files are made when they are asked for."""

    def __init__(self, folder):
        self.name, self.folder, self.sizes = "", folder, {}

    def start(self):
        if self.name:
            raise ConfigError("a recording is being written already")
        self.name = "new.mrl"
        self.sizes[self.name] = 5
        return self.name

    def stop(self):
        self.name = ""
        return ""

    def files(self):
        return [Recorded(name, size, name == self.name) for name, size in self.sizes.items()]

    def path(self, name):
        path = self.folder / name
        path.write_bytes(bytes(self.sizes[name]))
        return str(path)


class FakeRobot:
    """Stands still; `calls` has what it was told, in order."""

    def __init__(self, folder=""):
        self.source = self
        self.model = load("traxbot")
        self.limits = self.model.limits
        self.pose, self.ranges = ORIGIN, {}
        self.calls = []
        self.refuses = None
        self.latched = False
        self.stopped_by = None
        self.values = [0.0, math.nan, math.inf]
        self.names = [("x", "m"), ("y", "m"), ("sonar front", "m")]
        self.recordings = FakeRecordings(folder)
        self.readings = []
        self.changed = lambda: None

    def drive(self, linear_m_s, angular_rad_s, lateral_m_s, age_s):
        self.calls.append(("drive", linear_m_s, angular_rad_s, lateral_m_s))
        return self.refuses

    def go(self, goal, age_s):
        self.calls.append(("go", goal))
        return self.refuses

    def stop(self):
        self.calls.append(("stop",))

    def latch(self):
        self.latched = True
        self.calls.append(("latch",))

    def release(self):
        self.latched = False
        self.calls.append(("release",))

    def shown(self, now_s):
        trail = [Pose(i / 100, 0.0, 0.0) for i in range(3000)]
        return Shown(
            "traxbot 1", self.model, self.pose, Twist(0.0, 0.0), None, StopReason.USER, self.ranges, {}, 11.0, 0.5,
            "ok", [], True, 0.01, Row("errors", "0 lost"), now_s=now_s, rate_hz=50.0, trail=trail, distance_m=0.0,
        )  # fmt: skip

    def series(self):
        return self.names

    def sample(self):
        return self.values

    def listen(self, changed):
        self.changed = changed

    def phone(self, reading):
        self.readings.append(reading)
