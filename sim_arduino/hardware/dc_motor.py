"""A DC gearmotor on an H-bridge: back-EMF, winding resistance, friction, brake and coasting.

The winding's inductance is left out: its time constant (below 1 ms) is short compared with that of the speed.  Each
state of the bridge then has its own current at once, and the speed is of first order while shares and voltage are
constant: a step of any length is exact.  Speeds and distances are those of the encoder [count/s, count].
"""

import math
from typing import List, NamedTuple, Tuple

from .bridge import Shares

_SHORTEST_S = 1e-12  # a rest of a step that is left out [s]
_NEAR_S = 1e-7
"""A correction of an edge's time after which no further one is needed: the error is of the order of its square [s]."""
_MOST_STEPS = 60


class DcMotorParams(NamedTuple):
    """Data of a motor with its gearbox and its load, in the units of the equations."""

    resistance_ohm: float  # winding and bridge [Ohm]
    volts_per_count_s: float  # back-EMF per speed
    counts_s2_per_a: float  # acceleration per current
    friction_counts_s2: float  # deceleration by friction while the wheel turns
    static_counts_s2: float  # acceleration that a current must be worth to start the wheel
    drop_v: float = 0.0  # voltage lost in the bridge while it drives [V]


class Motion(NamedTuple):
    """A piece of motion in one direction: the speed approaches its end exponentially, or linearly at a rate of 0."""

    start_s: float  # start after the beginning of the step [s]
    duration_s: float
    travel: float  # travel at the start [count]
    speed: float  # speed at the start [count/s]
    acceleration: float  # acceleration at the start [count/s2]
    rate: float  # reciprocal of the time constant [1/s]

    def after(self, time_s: float) -> Tuple[float, float]:
        """Travel [count] and speed [count/s] at a time after the start [s]."""
        _, _, travel, speed, acceleration, rate = self
        u = rate * time_s
        if u < 1e-3:  # `first` is the time integral of exp(-rate t) [s], `second` the integral of that [s2]
            first, second = (
                time_s * (1.0 - u * (0.5 - u / 6.0)),
                time_s * time_s * (0.5 - u * (1.0 / 6.0 - u / 24.0)),
            )
        else:
            first = -math.expm1(-u) / rate
            second = (time_s - first) / rate
        return travel + speed * time_s + acceleration * second, speed + acceleration * first

    def time_to_rest(self) -> float:
        """Time after the start at which the speed becomes 0 [s]; infinite if it never does."""
        if self.speed * self.acceleration >= 0.0:
            return math.inf
        share = -self.speed * self.rate / self.acceleration
        if share >= 1.0:
            return math.inf
        return -math.log1p(-share) / self.rate if share > 0.0 else -self.speed / self.acceleration

    def time_at(self, travel: float) -> float:
        """Time after the start at which the wheel passes `travel` [s]; it must be within the motion."""
        side = math.copysign(1.0, self.speed or self.acceleration)
        low, high = 0.0, self.duration_s
        time_s = self._guess(max(0.0, (travel - self.travel) * side), side)
        for _ in range(_MOST_STEPS):
            place, speed = self.after(time_s)
            beyond = (place - travel) * side
            if beyond > 0.0:
                high = time_s
            else:
                low = time_s
            better = time_s - beyond / (speed * side) if speed else low
            if not low <= better <= high:
                better = 0.5 * (low + high)
            if abs(better - time_s) < _NEAR_S:
                return better
            time_s = better
        return time_s

    def _guess(self, way: float, side: float) -> float:
        """The time after which a motion at constant acceleration has gone `way` in the direction `side` [s]."""
        root = math.sqrt(max(0.0, self.speed**2 + 2.0 * self.acceleration * side * way))
        down = side * self.speed + root
        return min(self.duration_s, 2.0 * way / down) if down > 0.0 else self.duration_s


class DcMotor:
    """State of one motor."""

    def __init__(self, params: DcMotorParams) -> None:
        self.params = params
        self.travel = 0.0  # distance since power-up [count]; never wraps
        self.speed = 0.0  # speed [count/s]
        self.shares = Shares()  # what the bridge does; constant during a step
        self.blocked = False  # something holds the wheel
        self._charge_as = 0.0
        self._clock_s = 0.0
        self._motions: List[Motion] = []

    @property
    def at_rest(self) -> bool:
        """The motor stands still without current, and will not move before the bridge changes."""
        return self.speed == 0.0 and self.shares.forward == 0.0 == self.shares.backward

    def move(self, dt: float, volts: float) -> float:
        """Moves for `dt` [s] at constant shares and battery voltage; returns the distance [count]."""
        if self.at_rest:
            self._clock_s += dt
            return 0.0
        before = self.travel
        supply_v = max(0.0, volts - self.params.drop_v)
        end_s, left_s = self._clock_s + dt, dt
        while left_s > _SHORTEST_S:
            left_s -= self._move_one_way(left_s, supply_v)
        self._clock_s = end_s
        return self.travel - before

    def take_motions(self) -> List[Motion]:
        """The motions since the last call; rest between them is left out."""
        motions, self._motions = self._motions, []
        self._clock_s = 0.0
        return motions

    def take_charge(self) -> float:
        """Charge taken from the battery since the last call [A s]; braking against the battery gives some back."""
        charge, self._charge_as = self._charge_as, 0.0
        return charge

    def _move_one_way(self, longest_s: float, supply_v: float) -> float:
        """Moves until the wheel comes to rest, for `longest_s` at most; returns the time [s]."""
        if self.blocked:
            self.speed = 0.0
        motion = self._motion(longest_s, supply_v)
        if motion.speed == 0.0 == motion.acceleration:
            self._take(longest_s, 0.0, supply_v)
            return longest_s
        rest_s = motion.time_to_rest()
        duration_s = min(longest_s, rest_s)
        before = self.travel
        self.travel, self.speed = motion.after(duration_s)
        if rest_s <= longest_s:
            self.speed = 0.0
        self._motions.append(motion if duration_s == longest_s else motion._replace(duration_s=duration_s))
        self._take(duration_s, self.travel - before, supply_v)
        return duration_s

    def _motion(self, longest_s: float, supply_v: float) -> Motion:
        params, (forward, backward, brake, _) = self.params, self.shares
        per_volt = params.counts_s2_per_a / params.resistance_ohm
        drive = (forward - backward) * supply_v * per_volt
        rate = (forward + backward + brake) * params.volts_per_count_s * per_volt
        if self.speed:
            acceleration = drive - rate * self.speed - math.copysign(params.friction_counts_s2, self.speed)
        elif self.blocked or abs(drive) <= params.static_counts_s2:
            acceleration = 0.0
        else:
            acceleration = drive - math.copysign(params.friction_counts_s2, drive)
        return Motion(self._clock_s, longest_s, self.travel, self.speed, acceleration, rate)

    def _take(self, duration_s: float, way: float, supply_v: float) -> None:
        """Accounts for a step's charge: the battery's current flows only while the bridge drives."""
        forward, backward, _, _ = self.shares
        driven = (forward + backward) * supply_v * duration_s
        generated = (forward - backward) * self.params.volts_per_count_s * way
        self._charge_as += (driven - generated) / self.params.resistance_ohm
        self._clock_s += duration_s
