"""`python -m tests.experiments.record_house_keys` records the key presses of the mapping experiment.

It drives the emulated robot round the house as somebody who sees it would: turns on the spot until the robot points to
the next place, drives there, and stops.  The result is `house_keys.csv`; record it again if robot or world change.
"""

import csv
import math
import sys
from typing import List, Tuple

from mrl_driver.geometry import wrap_angle
from mrl_driver.terminal.teleop_keys import Teleop
from sim_arduino.experiments import key_presses, mapping
from sim_arduino.experiments.experiment_robot import TICK_S, ExperimentRobot, Setting, open_robot
from sim_arduino.experiments.key_presses import KeyPress
from sim_arduino.world import world_file

AGAIN_S = 0.5
"""A held key is pressed again after this time."""
LOOK_S = 2.0
"""The robot stands still for this time at the start, and for half of it at each place."""
THERE_M, OFF_RAD = 0.1, 0.08
ROLLS_S = 0.2
"""After a press of the space bar, the robot rolls on as far as it came in this time."""
SETTLE_S = 0.5
"""Until it stands."""
PLACES = (
    *((1.4, 1.15), (2.6, 1.15), (4.0, 1.15), (4.95, 0.9), (4.95, 1.6), (4.95, 2.8), (5.5, 3.2), (5.5, 4.4)),
    *((5.4, 3.2), (3.9, 3.0), (3.2, 4.5), (3.2, 3.95), (1.6, 3.95), (1.3, 3.2), (0.6, 3.2), (1.35, 2.9)),
    *((1.35, 1.5), (2.5, 1.6), (2.5, 0.5), (0.8, 0.8)),
)
"""Places by sight, through the middle of each door."""


class Person:
    """Drives, and keeps the key presses."""

    def __init__(self, robot: ExperimentRobot) -> None:
        self.presses: List[KeyPress] = []
        self._robot, self._teleop, self._start_s = robot, Teleop(), robot.driver.now_s

    def wait(self) -> None:
        """Let one tick pass."""
        self._robot.drive(*self._teleop.command(self._now_s()))
        self._robot.wait(TICK_S)

    def go(self, place: Tuple[float, float]) -> None:
        """Drive to a place, which the robot reaches or passes."""
        while self._away_m(place) > THERE_M:
            self._turn(place)
            self._hold("up", lambda: self._away_m(place) <= THERE_M or self._is_off(place))

    def _turn(self, place: Tuple[float, float]) -> None:
        if not self._is_off(place):
            return
        sign = math.copysign(1.0, self._off_rad(place))
        self._hold("left" if sign > 0 else "right", lambda: sign * self._off_rad(place) < self._lead_rad())

    def _is_off(self, place: Tuple[float, float]) -> bool:
        """The robot would miss the place."""
        return abs(self._off_rad(place)) > max(OFF_RAD, math.asin(min(1.0, THERE_M / self._away_m(place))))

    def _lead_rad(self) -> float:
        """The robot turns on by this angle after a press of the space bar."""
        before = self._robot.driver.twist[-1]
        return abs(before) * ROLLS_S

    def _hold(self, key: str, until) -> None:  # type: ignore[no-untyped-def]
        pressed_s = -math.inf
        while not until():
            if self._now_s() - pressed_s >= AGAIN_S:
                pressed_s = self._now_s()
                self._press(key)
            self.wait()
        self._press("space")
        for _ in range(round(SETTLE_S / TICK_S)):
            self.wait()

    def _press(self, key: str) -> None:
        now_s = self._now_s()
        self.presses.append(KeyPress(now_s, key))
        self._teleop.press(key, now_s)

    def _now_s(self) -> float:
        return self._robot.driver.now_s - self._start_s

    def _off_rad(self, place: Tuple[float, float]) -> float:
        pose = self._robot.true_pose
        return wrap_angle(math.atan2(place[1] - pose.y_m, place[0] - pose.x_m) - pose.yaw_rad)

    def _away_m(self, place: Tuple[float, float]) -> float:
        pose = self._robot.true_pose
        return math.hypot(place[0] - pose.x_m, place[1] - pose.y_m)


def main() -> int:
    """Record."""
    world = world_file.load(mapping.WORLD)
    setting = Setting("", robot=mapping.ROBOT)
    with open_robot(setting, world, period_ms=mapping.PERIOD_MS, slip=True) as robot:
        person = Person(robot)
        for _ in range(round(LOOK_S / TICK_S)):
            person.wait()
        for place in PLACES:
            person.go(place)
            for _ in range(round(0.5 * LOOK_S / TICK_S)):
                person.wait()
    with open(mapping.KEYS, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(key_presses.COLUMNS)
        writer.writerows((f"{press.time_s:.2f}", press.key) for press in person.presses)
    print(f"{len(person.presses)} presses in {person.presses[-1].time_s:.0f} s: {mapping.KEYS}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
