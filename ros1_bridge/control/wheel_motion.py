"""Whether the wheels turn, by their counts.  No ROS."""

from typing import Any, Optional, Sequence, Tuple

STILL_M_S = 0.005  # a wheel whose rim is slower than this counts as standing still [m/s]
WINDOW_S = 0.15  # speeds are means over at least this time [s], so that single counts do not look like motion


class WheelMotion:
    """Motion of the wheels of one robot; any thread may ask, some times a second."""

    def __init__(self, driver: Any) -> None:
        self._driver = driver
        self._moving: Optional[bool] = None
        self._from: Optional[Tuple[float, Sequence[float]]] = None

    def moving(self) -> Optional[bool]:
        """Return whether a wheel turns; None if that is not known.

        Without telemetry it is known of boards with a watchdog, which has stopped the robot.
        """
        driver = self._driver
        if not driver.ready:
            self._moving, self._from = (None if driver.may_be_moving else False), None
        elif not driver.model.has_odometry:
            self._moving = None
        elif driver.telemetry is not None:
            self._measure(driver.telemetry)
        return self._moving

    def _measure(self, telemetry: Any) -> None:
        stamp_s, counts, before = telemetry.stamp_s, telemetry.counts, self._from
        if before is None:
            if self._moving is None:  # a first look, by the last frame alone
                self._moving = any(abs(speed) > STILL_M_S for speed in telemetry.twist)
        elif stamp_s - before[0] < WINDOW_S:
            return
        else:
            most = max(abs(now - then) for now, then in zip(counts, before[1]))
            way_m = most * self._driver.model.drive.metres_per_count
            self._moving = way_m > STILL_M_S * (stamp_s - before[0])
        self._from = stamp_s, counts
