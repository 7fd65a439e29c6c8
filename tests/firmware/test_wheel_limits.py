"""The firmware's control of a wheel at the limits of its numbers: settings, supervision, speed, counter, ramp, control.

The emulated board's twin goes along in each period, so that no other number differs.
"""

from typing import List

import pytest

from mrl_driver.protocol.stop_reason import STOP_REASONS
from sim_arduino.board.bridge.wheel import Wheel
from sim_arduino.board.bridge.wheel_settings import FULL, PERIOD_TICKS
from sim_arduino.board.bridge.wheel_watch import WheelWatch
from tests.firmware.test_wheel import KIT, Parts

# ---- settings: parameters at which one unit of a constant, or the rounding, decides

SLOWEST_COUNTS = {
    "full_speed": 4,
    "gearbox": 9319,
    "encoder_counts": 8,
    "wheel_radius": 32767,
    "axis_radius": 1,
}
"""50 counts a second at full speed: 64/256 of a count in a period."""
FASTEST_COUNTS = {"full_speed": 25, "gearbox": 12823, "encoder_counts": 480}
"""25 600 counts a second at full speed: 32767/256 counts in a period."""
SLOWEST_RIM = {
    "full_speed": 4,
    "wheel_radius": 15279,
    "gearbox": 2000,
    "encoder_counts": 17000,
    "axis_radius": 6250,
}
"""64 mm/s at full speed: 65535/256 of a share for each mm/s, and 65535/4096 for each mrad/s; 340 000 counts a turn."""


@pytest.mark.parametrize(
    "good, bad",
    [
        (SLOWEST_COUNTS, {"gearbox": 9318}),
        (FASTEST_COUNTS, {"gearbox": 32395, "encoder_counts": 190}),
        (SLOWEST_RIM, {"full_speed": 5, "wheel_radius": 12223, "axis_radius": 1}),
        (SLOWEST_RIM, {"axis_radius": 6251}),
        (SLOWEST_RIM, {"gearbox": 2125, "encoder_counts": 16001}),
    ],
    ids=["slowest counts", "fastest counts", "slowest rim", "slowest turn", "most counts a turn"],
)
def test_settings_end_at_the_last_number_that_can_be_controlled(good, bad):
    parts = Parts(**{**KIT, **good})
    assert parts.found is not None and parts.found == parts.settings
    assert Parts(**{**KIT, **good, **bad}).found is None


ROUNDED = [
    ("friction_duty", (0, 1, 319, 431, 444, 500)),
    ("kp", (354, 396, 479, 521, 992, 993, 994)),
    ("ki", (81, 243, 350, 457, 512, 1536)),
    ("reversal_pause", (302, 307, 317, 322, 1000)),
    ("ramp_time", (1, 2, 3, 6, 7, 37)),
    ("axis_radius", (1, 6249, 6250, 7813)),
]


@pytest.mark.parametrize("name, values", ROUNDED, ids=[name for name, _ in ROUNDED])
def test_settings_are_rounded_as_by_the_emulated_board(name, values):
    """Values at which one unit of a factor, or of the rounding, gives another number."""
    for value in values:
        parts = Parts(**{**KIT, name: value})
        assert parts.found is not None and parts.found == parts.settings, value


@pytest.mark.parametrize(
    "full_speed, gearbox, encoder_counts", [(8, 31438, 193), (2, 24085, 196), (4, 26195, 8)]
)
def test_divisions_of_settings_are_exact(full_speed, gearbox, encoder_counts):
    """10337, 2011 and 179/256 counts in a period at full speed divide their constants, or one more, without a rest."""
    numbers = {"full_speed": full_speed, "gearbox": gearbox, "encoder_counts": encoder_counts}
    parts = Parts(**{**KIT, **numbers, "wheel_radius": 32767, "axis_radius": 1})
    assert parts.found is not None and parts.found == parts.settings


# ---- supervision


class Watched:
    """The watch of a wheel, and its twin, which must say the same."""

    def __init__(self, counted: int = 16, **values: int) -> None:
        """`counted`: periods in which the encoder has counted before."""
        self.parts, self.twin = Parts(**{**KIT, **values}), WheelWatch()
        self.run(counted, direction=0, moved=1)

    def run(
        self,
        periods: int,
        moved: int = 0,
        direction: int = 1,
        duty: int = FULL,
        speed: int = 0,
        edges: bool = False,
        controlled: bool = True,
    ) -> List[str]:
        """The reason of each period."""
        reasons = []
        for _ in range(periods):
            args = (direction, duty, moved, edges or moved != 0, speed, controlled)
            reasons.append(STOP_REASONS[self.parts.native.pc_watch_update(*args)])
            assert reasons[-1] == self.twin.update(self.parts.settings, *args)
        return reasons


@pytest.mark.parametrize("counted, reason, periods", [(15, "encoder", 20), (16, "wheel_blocked", 40)])
def test_an_encoder_that_has_counted_16_times_is_not_silent(counted, reason, periods):
    """A silent one stops the motors after 20 periods at full duty, a blocked wheel after 40."""
    assert Watched(counted).run(periods) == ["none"] * (periods - 1) + [reason]


def test_a_wheel_stays_blocked_as_long_as_it_stands():
    """Also after 256 periods."""
    assert Watched().run(300)[39:] == ["wheel_blocked"] * 261


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("speed, wrong_after", [(0, 17), (1, 117)])
def test_a_wheel_that_still_turns_back_gets_half_a_second_before_its_counts_are_wrong(
    direction, speed, wrong_after
):
    """The slightest measured speed decides.  Counts are wrong after 16 periods, patience is 100."""
    against = -direction
    reasons = Watched().run(wrong_after, moved=against, direction=direction, duty=0, speed=against * speed)
    assert reasons == ["none"] * (wrong_after - 1) + ["encoder"]


def test_a_count_to_and_fro_is_forgotten():
    """The 16 periods begin with the next wrong count."""
    watched = Watched()
    for moved in (-1, 1, 0, 0, 0, 0, 0, 0, -1):
        assert watched.run(1, moved=moved, duty=0) == ["none"]
    watched.run(1, moved=-1, duty=0)
    assert watched.run(15, duty=0) == ["none"] * 14 + ["encoder"]


@pytest.mark.parametrize("last_duty, periods", [(FULL, 128), (FULL // 64 * 63, 129)])
def test_a_slow_wheel_is_blocked_when_it_should_have_counted_32(last_duty, periods):
    """At full duty it counts 64/256 in a period; 1/256 of a count less needs another period."""
    watched = Watched(**SLOWEST_COUNTS)
    watched.run(50)
    watched.run(1, moved=3)  # begins again
    assert watched.run(127) == ["none"] * 127
    reasons = watched.run(1, duty=last_duty) + watched.run(1)
    assert reasons.index("wheel_blocked") == periods - 128


# ---- ramp and control


class Turned:
    """A wheel, and its twin, which must have the same output in each period."""

    def __init__(self, **values: int) -> None:
        self.parts, self.twin = Parts(**{**KIT, **values}), Wheel()
        self.tick = self.edge_tick = 0

    def give(self, command: str, *args: int) -> None:
        getattr(self.twin, command)(*args)
        self.parts.is_driven_by(command, *args)

    def run(self, periods: int, moved: int = 0) -> List[int]:
        """The level of each period; the last edge of a period is at its end."""
        levels = []
        for _ in range(periods):
            self.tick = self.tick + PERIOD_TICKS & 0xFFFF
            self.edge_tick = self.tick if moved else self.edge_tick
            self.reason = STOP_REASONS[self.parts.native.pc_wheel_update(moved, self.edge_tick, self.tick)]
            assert self.reason == self.twin.update(self.parts.settings, moved, self.edge_tick, self.tick)
            levels.append(self.parts.native.pc_wheel_level())
            assert levels[-1] == self.twin.level()
            assert self.direction == self.twin.last_direction
        return levels

    @property
    def direction(self) -> int:
        return int(self.parts.native.pc_wheel_last_direction())

    def speed_of(self, counts: int) -> int:
        """The measured speed while the wheel counts this much in each period."""
        return int(self.parts.settings.share_per_count_tick * counts // PERIOD_TICKS)


OPEN = {"kp": 0, "ki": 0, "friction_duty": 0}  # No control: the duty is the setpoint
SLOW_INTEGRAL = {**OPEN, "ki": 3}  # An error of 1 changes the integral by the least that it has
FAST_INTEGRAL = {**OPEN, "ki": 32767}
RAMP_TIME = 919
"""[ms]; the setpoint, which has eight more bits, is one below a whole share after the first period."""


def test_a_new_wheel_turns_backward_without_a_pause():
    wheel = Turned(reversal_pause=1000)
    wheel.run(1)
    wheel.give("set_speed", -1000)
    assert wheel.run(1)[0] < 0


@pytest.mark.parametrize("share", [1, -1])
def test_the_least_duty_drives_in_its_direction(share):
    """1/16384 of 255 levels: one in 65 periods."""
    wheel = Turned()
    wheel.give("set_duty", share)
    assert sum(wheel.run(65)) == share and wheel.direction == share


@pytest.mark.parametrize("speed", [1, -1])
def test_the_sign_of_the_speed_to_a_position_does_not_matter(speed):
    wheel = Turned(**OPEN)
    wheel.give("go_to", 100, speed)
    assert sum(wheel.run(65)) == 1


def test_the_speed_to_a_position_grows_no_more_beyond_5000_counts():
    wheel = Turned(**OPEN, **FASTEST_COUNTS)
    wheel.give("go_to", 5000, FULL)
    near = wheel.run(50)
    wheel.give("go_to", 50_000, FULL)
    assert abs(sum(wheel.run(50)) - sum(near)) <= 1 and near[0] < 255


def test_the_integral_begins_at_zero_with_a_new_mode():
    wheel = Turned(**SLOW_INTEGRAL)
    wheel.give("set_duty", 5000)
    wheel.run(5, moved=10)
    watch_the_least_error(wheel)


def test_the_integral_begins_at_zero_after_a_stop():
    wheel = Turned(**SLOW_INTEGRAL)
    wheel.give("set_speed", wheel.speed_of(10) + 100)
    wheel.run(5, moved=10)
    wheel.give("stop")
    watch_the_least_error(wheel)


def test_the_integral_begins_at_zero_after_a_rest():
    wheel = Turned(**SLOW_INTEGRAL)
    wheel.give("set_speed", wheel.speed_of(10) + 100)
    wheel.run(5, moved=10)
    wheel.give("set_speed", 0)
    wheel.run(1, moved=10)
    watch_the_least_error(wheel)


def watch_the_least_error(wheel: Turned) -> None:
    """An error of -1 in one period makes an integral of zero negative: the duty is one less from then on."""
    speed = wheel.speed_of(10)
    wheel.give("set_speed", speed - 1)
    wheel.run(1, moved=10)
    wheel.give("set_speed", speed)
    levels = wheel.run(128, moved=10)
    assert sum(levels) == pytest.approx(128 * 255 * (speed - 1) / FULL, abs=1)


def test_the_ramp_begins_at_zero_after_a_stop():
    wheel = Turned(ramp_time=RAMP_TIME)
    wheel.give("set_duty", FULL)
    wheel.run(50)
    wheel.give("stop")
    wheel.give("set_duty", FULL)
    assert max(wheel.run(RAMP_TIME // 5)) < 255


def test_a_wheel_is_supervised_to_the_end_of_the_period_of_its_stop():
    wheel = Turned()
    wheel.give("set_speed", FULL // 4)
    wheel.run(2)
    wheel.run(16, moved=-5)
    assert wheel.reason == "none"
    wheel.give("stop")
    wheel.run(1, moved=-5)
    assert wheel.reason == "encoder"


def test_the_least_error_does_not_wind_the_integral_up_at_full_duty():
    wheel = Turned(**FAST_INTEGRAL)
    wheel.give("set_speed", wheel.speed_of(10) + 1)
    assert wheel.run(100)[-1] == 255
    wheel.run(40, moved=10)
    wheel.give("set_speed", 3000)
    assert wheel.run(60, moved=10)[-1] == 0


@pytest.mark.parametrize("speed, before, after", [(1, -45, 1000), (FULL, 45, -1000)])
def test_the_integral_ends_at_full_duty(speed, before, after):
    """The wheel winds it up, then jumps, so that the proportional part shows it in one period.

    The rest of that period's output comes with the next ones.
    """
    wheel = Turned(**{**FAST_INTEGRAL, "kp": 1})
    wheel.give("set_speed", speed)
    wheel.run(30, moved=before)
    wheel.run(1, moved=after)
    wheel.give("set_duty", 100)
    wheel.run(128)
