"""The H-bridge chips: what a motor's terminals do for the levels of its three wires, and for duties on them.

Forward means that terminal A (OUT1, M+) is positive.  The wires are in the order PWM_A, PWM_B, LOGIC of HARDWARE.md.
"""

from functools import lru_cache
from typing import Dict, NamedTuple, Tuple


class Shares(NamedTuple):
    """Shares of time of the four states; their sum is 1."""

    forward: float = 0.0
    backward: float = 0.0
    brake: float = 0.0
    coast: float = 1.0

    def reversed(self) -> "Shares":
        """The shares of a motor whose terminals are swapped."""
        return self._replace(forward=self.backward, backward=self.forward)


F, B, K, C = STATES = Shares._fields
"""Braking, both terminals are at the same voltage: the motor is short-circuited.  Coasting, no current can flow, except
while the winding's own decays."""


class Bridge(NamedTuple):
    """One kind of bridge."""

    rows: Tuple[Tuple[str, str], ...]
    """Levels of the wires ("1", "0", "x" either) and the state; the first row that fits holds."""
    resistance_ohm: float  # resistance of both switches in the motor's path
    drop_v: float = 0.0  # voltage that the bridge loses at any current while it drives

    def state(self, levels: str) -> str:
        """State at the levels of PWM_A, PWM_B and LOGIC, such as "101"."""
        return next(
            state for row, state in self.rows if all(want in ("x", got) for want, got in zip(row, levels))
        )

    def shares(self, pwm_a: float, pwm_b: float, logic: float) -> Shares:
        """Shares of time of the states, for the shares 0 to 1 of time for which each wire is high.

        Wires with PWM rise or lie together, because both come from one timer: while the wire with the smaller duty is
        high, the other one is high too.
        """
        return _shares(self, pwm_a, pwm_b, logic)


@lru_cache(maxsize=4096)
def _shares(bridge: Bridge, *duties: float) -> Shares:
    shares = dict.fromkeys(STATES, 0.0)
    limits = sorted({0.0, 1.0, *(min(1.0, max(0.0, duty)) for duty in duties)})
    for low, high in zip(limits, limits[1:]):
        levels = "".join("1" if duty > low else "0" for duty in duties)
        shares[bridge.state(levels)] += high - low
    return Shares(*shares.values())


# L298N: ST L298, January 2000, figure 6: wires EN, IN1, IN2.  EN low is free running, equal inputs are a fast motor
# stop.  Saturation of both transistors: typically 2.55 V at 1 A and 3.7 V at 2 A.
_L298N = Bridge((("0xx", C), ("110", F), ("101", B), ("111", K), ("100", K)), 1.15, 1.4)
_L298P = _L298N._replace(rows=(("0xx", C), ("11x", K), ("100", F), ("101", B)))
BRIDGES: Dict[int, Bridge] = {
    # VNH5019: ST VNH5019A-E, Doc ID 15701 Rev 7, table 11: wires PWM, INA, INB.  Section 2.4: PWM low turns both
    # low-side switches off, so PWM is drive and coast; both inputs high brake to the supply whatever PWM is.
    # 18 mOhm: its first page.
    1: Bridge((("x11", K), ("110", F), ("101", B), ("100", K), ("0xx", C)), 0.018),
    # MDxx: Cytron MD10C, table on the board: wires PWM, DIR.  PWM low pulls both outputs low; DIR low makes output A
    # high.  30 mOhm: assumed.
    2: Bridge((("0xx", K), ("1x0", F), ("1x1", B)), 0.03),
    3: _L298N,  # PWM on IN1
    # TB6612: Toshiba TB6612FNG, 2014-10-01, H-SW control function: wires PWM, IN1, IN2.  PWM low is a short brake.  All
    # inputs low is not in its table: assumed off, as with PWM high.  0.5 Ohm: its first page.
    4: Bridge((("x11", K), ("110", F), ("101", B), ("010", K), ("001", K), ("x00", C)), 0.5),
    # DRV8833: TI DRV8833, SLVSAR1, table 1 and 2: wires IN1, IN2.  PWM on one input with the other one low is fast
    # decay (drive and coast), with the other one high slow decay (drive and brake).  360 mOhm: its first page.
    # Its SLEEP is the enable.
    5: Bridge((("xx0", C), ("10x", F), ("01x", B), ("11x", K), ("00x", C)), 0.36),
    # BTS7960: Infineon BTS 7960, Rev. 1.1 2004-12-07, section 4.4.1: wires RPWM, LPWM and both INH, the enable.  While
    # INH is high each half bridge has one switch on.  16 mOhm: its first page.
    6: Bridge((("xx0", C), ("10x", F), ("01x", B), ("11x", K), ("00x", K)), 0.016),
    7: _L298N,  # PWM on EN
    # Shields with an L298P: wires PWM (EN), brake, DIR.  Arduino, schematic of the Motor Shield Rev3: IN1 is DIR, IN2
    # its inverse, and the same as IN1 while the brake is high.  EN low is free running whatever the brake is.
    8: _L298P,
    9: _L298P,
}
"""The bridges by the value of parameter 19."""
