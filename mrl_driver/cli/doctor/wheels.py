"""Checks with motion: each wheel in turn, and a hand in front of each sonar."""

import math
import time
from typing import TYPE_CHECKING, Callable, Dict, Iterator, Mapping, NamedTuple, Optional

from mrl_driver.protocol.stop_reason import PASSING
from mrl_driver.robot.odometry import Wheels
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.view.words import fault_code, stop_error

from .findings import OK, Finding, fault, note, ok

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

WHEEL_M_S, TURN_S, REST_S = 0.1, 1.5, 2.0
STEP_S, LONGEST = 0.02, 5
"""Time between two commands [s].  A step in which this computer or the board paused counts as at most two, and a turn
lasts at most this many times `TURN_S`."""
MIN_MOVED_M, OTHER_WHEEL_SHARE = 0.02, 0.3
"""A wheel has turned if it moved at least this far [m]; the other one may move by this share of its distance."""
CLOSER_M, HAND_M = 0.2, 0.6
"""A hand is in front of a sonar if it reads below `HAND_M`, and at least `CLOSER_M` less than before [m]."""
PATIENCE_S = 15.0  # the user has this long to hold a hand in front of a sonar [s]
_MOTORS = {"right": "motor and encoder 3", "left": "motor and encoder 1"}

Ask = Callable[[str], bool]


class Moved(NamedTuple):
    """Movement by both counters after one wheel was commanded forward [m]."""

    right_m: float
    left_m: float
    fault: Optional[Mismatch] = None  # for which the robot was stopped early


def check(driver: "Driver", ask: Optional[Ask]) -> Iterator[Finding]:
    """Turn each wheel forward for a moment; `ask` asks the user, who sees the wheels."""
    if driver.battery_state in ("empty", "off"):
        state = driver.battery_state
        yield fault(f"battery_{state}", "wheels", f"not checked: the battery is {state}")
        return
    for side in Wheels._fields:
        finding = evaluate(side, turn(driver, side))
        if finding.level == OK and ask is not None and not ask(f"Did the {side} wheel turn forward, alone?"):
            finding = fault(
                "wheels_swapped",
                f"{side} wheel",
                "its counter is right, but another wheel turned, or this one turned backwards",
                f"motor and encoder wires are both swapped: {side} is {_MOTORS[side]}, forward counts up",
            )
        yield finding
    if ask is None:
        text = "only the counters were checked; look whether each wheel turned forward"
        yield note("wheels_unchecked", "wheels", text)._replace(advice="")


def turn(driver: "Driver", side: str) -> Moved:
    """Turn one wheel forward, and stop; BoardTimeout if a bumper or another input stopped the robot."""
    model = driver.model
    assert model is not None
    metres, separation_m = model.base.metres_per_count, model.base.wheel_separation_m
    start = _counts(driver)
    yaw_rate = WHEEL_M_S / separation_m
    command = WHEEL_M_S / 2, yaw_rate if side == "right" else -yaw_rate
    left_s, end_s, made_s = TURN_S, driver.now_s + LONGEST * TURN_S, _stamp_s(driver)
    while driver.mismatch is None and left_s > 0.0 and driver.now_s < end_s:
        driver.drive(*command)  # again also after a silence, in which the driver drops its command
        driver.wait(STEP_S)
        if driver.command is None and driver.mismatch is None and driver.stop_reason not in PASSING:
            raise stop_error(driver, "stopped early")
        before_s, made_s = made_s, _stamp_s(driver)
        left_s -= min(made_s - before_s, 2 * STEP_S)
    mismatch = driver.mismatch
    driver.stop()
    end_s = driver.now_s + REST_S
    while not driver.stopped and driver.now_s < end_s:
        driver.wait(STEP_S)
    now = _counts(driver)
    return Moved((now.right - start.right) * metres, (now.left - start.left) * metres, mismatch)


def _stamp_s(driver: "Driver") -> float:
    telemetry = driver.telemetry
    return telemetry.stamp_s if telemetry else 0.0


def _counts(driver: "Driver") -> Wheels:
    telemetry = driver.telemetry
    return Wheels(*telemetry.counts[:2]) if telemetry else Wheels(0, 0)


def evaluate(side: str, moved: Moved) -> Finding:
    """Return the finding for a wheel that was commanded forward alone, from the counters."""
    own, other = (moved.right_m, moved.left_m) if side == "right" else (moved.left_m, moved.right_m)
    words = f"{own * 1000:.0f} mm, the other wheel {other * 1000:.0f} mm"
    wheel = f"{side} wheel"
    if own >= MIN_MOVED_M and abs(other) <= OTHER_WHEEL_SHARE * own:
        if moved.fault is not None:
            return fault(fault_code(moved.fault), wheel, f"{moved.fault} ({words})")
        return ok(wheel, f"turns and counts forward ({words})")
    if own <= -MIN_MOVED_M and abs(other) <= OTHER_WHEEL_SHARE * -own:
        return fault("wheel_reversed", wheel, f"counts backwards ({words})")
    if abs(other) >= MIN_MOVED_M > abs(own):
        advice = f"swap the plugs: {side} is {_MOTORS[side]}"
        return fault("wheels_swapped", wheel, f"the other wheel's counter moved ({words})", advice)
    if abs(own) < MIN_MOVED_M and abs(other) < MIN_MOVED_M:
        advice = "if it turned, check the plug of its encoder; if not, check motor power and motor plug"
        return fault("wheel_dead", wheel, f"no counter moved ({words})", advice)
    advice = "check into which socket each encoder is plugged"
    return fault("wheels_swapped", wheel, f"both counters moved ({words})", advice)


def sonar_order(read: Callable[[], Mapping[str, float]], ask: Ask) -> Iterator[Finding]:
    """Ask the user (by `ask`) to hold a hand in front of each sonar in turn; the answer False skips the sonar."""
    for name in list(read()):
        if ask(f"Hold a hand about 30 cm in front of the {name} sonar.  Ready?"):
            yield _order(name, _await_hand(read))
        else:
            yield note("sonar_missed", f"sonar {name}", "order not checked")._replace(advice="")


def _await_hand(read: Callable[[], Mapping[str, float]]) -> str:
    end_s, found = time.monotonic() + PATIENCE_S, ""
    while not found and time.monotonic() < end_s:
        time.sleep(0.05)
        found = nearest(read())
    return found


def nearest(ranges: Mapping[str, float]) -> str:
    """Return the sonar with a hand in front of it; empty if there is none, or if several are possible."""
    near: Dict[str, float] = {
        name: max(0.0, value) for name, value in ranges.items() if not math.isnan(value) and value < HAND_M
    }
    others = [value for name, value in ranges.items() if name not in near and not math.isnan(value)]
    if len(near) != 1 or any(value < min(near.values()) + CLOSER_M for value in others):
        return ""
    return next(iter(near))


def _order(name: str, seen: str) -> Finding:
    if seen == name:
        return ok(f"sonar {name}", "is in its place")
    if seen:
        advice = f"swap the outputs of {name} and {seen}"
        return fault("sonar_swapped", f"sonar {name}", f"the {seen} sonar detected the hand", advice)
    return fault("sonar_missed", f"sonar {name}", "did not detect the hand")
