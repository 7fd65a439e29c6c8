"""`python -m tests.experiments.record_house_keys` records the key presses of the mapping experiment.

It drives the emulated robot round the house as somebody who sees it would: turns on the spot until the robot points to
the next place, drives there, and stops.  The result is `house_keys.csv`; record it again if robot or world change.
"""

import csv
import math

from mrl_driver.geometry import wrap_angle
from mrl_driver.terminal.teleop_keys import Teleop
from sim_arduino.experiments import mapping
from sim_arduino.experiments.experiment_robot import TICK_S, Setting, open_robot
from sim_arduino.experiments.mapping import KeyPress
from sim_arduino.world import world_file

AGAIN_S = 0.5  # A held key is pressed again after this time
LOOK_S = 2.0  # The robot stands still for this time at the start, and for half of it at each place
THERE_M, OFF_RAD = 0.1, 0.08
ROLLS_S = 0.2  # After a press of the space bar, the robot rolls on as far as it came in this time
SETTLE_S = 0.5  # Until it stands
PLACES = (
    *((1.4, 1.15), (2.6, 1.15), (4.0, 1.15), (4.95, 0.9), (4.95, 1.6), (4.95, 2.8), (5.5, 3.2), (5.5, 4.4)),
    *((5.4, 3.2), (3.9, 3.0), (3.2, 4.5), (3.5, 4.6), (3.2, 3.95), (1.6, 3.95), (1.3, 3.2), (0.6, 3.2)),
    *((1.35, 2.9), (1.35, 1.5), (2.5, 1.6), (2.5, 0.5), (0.8, 0.8)),
)
"""Places by sight, through the middle of each door."""


class Person:
    """Drives, and keeps the key presses."""

    def __init__(self, robot):
        self.presses = []
        self._robot, self._teleop, self._start_s = robot, Teleop(), robot.driver.now_s

    @property
    def _now_s(self):
        return self._robot.driver.now_s - self._start_s

    def wait(self, seconds=TICK_S):
        for _ in range(round(seconds / TICK_S)):
            self._robot.drive(*self._teleop.command(self._now_s))
            self._robot.wait(TICK_S)

    def go(self, place):
        """Drives to a place, which the robot reaches or passes."""
        while self._away(place)[0] > THERE_M:
            if self._is_off(place):
                sign = math.copysign(1.0, self._away(place)[1])
                key = "left" if sign > 0 else "right"
                self._hold(key, lambda sign=sign: sign * self._away(place)[1] < self._lead_rad())
            self._hold("up", lambda: self._away(place)[0] <= THERE_M or self._is_off(place))

    def _is_off(self, place):
        """The robot would miss the place."""
        away_m, off_rad = self._away(place)
        return abs(off_rad) > max(OFF_RAD, math.asin(min(1.0, THERE_M / away_m)))

    def _lead_rad(self):
        """The robot turns on by this angle after a press of the space bar."""
        return abs(self._robot.driver.twist[-1]) * ROLLS_S

    def _hold(self, key, until):
        pressed_s = -math.inf
        while not until():
            if self._now_s - pressed_s >= AGAIN_S:
                pressed_s = self._now_s
                self._press(key)
            self.wait()
        self._press("space")
        self.wait(SETTLE_S)

    def _press(self, key):
        self.presses.append(KeyPress(self._now_s, key))
        self._teleop.press(key, self._now_s)

    def _away(self, place):
        """Distance of the place, and its direction as the robot sees it."""
        pose = self._robot.true_pose
        x_m, y_m = place[0] - pose.x_m, place[1] - pose.y_m
        return math.hypot(x_m, y_m), wrap_angle(math.atan2(y_m, x_m) - pose.yaw_rad)


def main():
    world, setting = world_file.load(mapping.WORLD), Setting("", robot=mapping.ROBOT)
    with open_robot(setting, world, period_ms=mapping.PERIOD_MS, slip=True) as robot:
        person = Person(robot)
        person.wait(LOOK_S)
        for place in PLACES:
            person.go(place)
            person.wait(0.5 * LOOK_S)
    with open(mapping.KEYS, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(KeyPress._fields)
        writer.writerows((f"{press.time_s:.2f}", press.key) for press in person.presses)
    print(f"{len(person.presses)} presses in {person.presses[-1].time_s:.0f} s: {mapping.KEYS}")


if __name__ == "__main__":
    main()
