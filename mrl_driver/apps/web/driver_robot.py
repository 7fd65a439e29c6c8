"""The robot behind the page, over a driver."""

import contextlib
import json
import math
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Optional

from mrl_driver.errors import MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.inputs import RELEASE
from mrl_driver.session.events import SensorRead
from mrl_driver.view.shown_state import Shown
from mrl_driver.view.words import stopped_by, why_refused

from .helm import Why
from .robot import REMEDY, PageRobot, PhoneReading, Recordings

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

SUFFIX = ".mrl"
AGE_S = 1.0  # the age of the last command is shown for this time [s]
LATCHED = Why(StopReason.EMERGENCY_STOP, "the emergency stop is on; release it first")


class DriverRobot(PageRobot):
    """Shows and drives the robot of a connected driver; recordings go to files of a folder."""

    def __init__(self, driver: "Driver", folder: str) -> None:
        super().__init__(driver, DriverRecordings(driver, folder))
        self._driver = driver
        self._driven = False  # a command of the page was in force, and `stop` has not ended it
        self._latched, self._driven_s = False, -AGE_S

    def _drive(
        self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float
    ) -> Optional[Why]:
        driver = self._driver
        why = LATCHED if self.latched else self.stopped_by
        if why is not None:  # the robot has stopped between two commands, and the server has not seen it yet
            return why
        try:
            if driver.drive(linear_m_s, angular_rad_s, lateral_m_s) or driver.command is not None:
                self._driven, self._age_s, self._driven_s = True, age_s, time.monotonic()
                return None
            return self._why(why_refused(driver, REMEDY))
        except MrlError as error:
            return self._why(str(error))

    def _refusal(self) -> Optional[Why]:
        return None if self._driver.ready else self._why(why_refused(self._driver, REMEDY))

    def _why(self, words: str) -> Why:
        return Why(self._driver.stop_reason, words)

    def stop(self) -> None:
        self._end(self._driver.stop)

    def latch(self) -> None:
        self._latched = True
        self._end(lambda: self._driver.inhibit(StopReason.EMERGENCY_STOP))

    def _end(self, stop: Callable[[], None]) -> None:
        self._driven = False
        self._seeker = None
        try:
            stop()
        except MrlError as error:  # the driver sends it again later, or has ended and says why
            self._live.notice = str(error)

    def release(self) -> None:
        self._latched = False
        self._driver.allow(StopReason.EMERGENCY_STOP)
        if self._input_latched:
            self._end(self._driver.stop)
            with contextlib.suppress(MrlError):  # the driver has ended; it says so itself
                self._driver.request(RELEASE)

    @property
    def latched(self) -> bool:
        return self._latched or self._input_latched

    @property
    def _input_latched(self) -> bool:
        inputs = self._driver.inputs
        return inputs is not None and inputs.latched

    @property
    def stands(self) -> bool:
        return self._driver.stopped

    @property
    def stopped_by(self) -> Optional[Why]:
        if not self._driven or self._driver.command is not None:
            return None
        return self._why(stopped_by(self._driver))

    def shown(self, now_s: float) -> Shown:
        if now_s - self._driven_s >= AGE_S:
            self._age_s = math.nan
        return super().shown(now_s)

    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` for whatever the board sends, on the reading thread."""

        def wake(_: object) -> None:
            changed()

        driver = self._driver
        if driver.model is not None and driver.model.drives:
            driver.on_telemetry(wake)
        else:
            driver.on(SensorRead, wake)
        driver.on_event(wake)

    def phone(self, reading: PhoneReading) -> None:
        """Write a reading of the phone's sensors into the recording, if there is one."""
        if self._driver.recorder.file is None:
            return
        facts: Dict[str, Any] = {
            name: list(value) if isinstance(value, tuple) else None if value != value else value
            for name, value in reading._asdict().items()
        }
        with contextlib.suppress(MrlError):  # the driver has ended; it says so itself
            self._driver.recorder.remark(f"phone {json.dumps(facts)}")


class DriverRecordings(Recordings):
    """The recordings of a driver."""

    def __init__(self, driver: "Driver", folder: str) -> None:
        super().__init__(Path(folder), SUFFIX)
        self._recorder = driver.recorder

    @property
    def name(self) -> str:
        file = self._recorder.file
        return os.path.basename(file.path) if file is not None else ""

    def start(self) -> str:
        name = self._new(time.strftime("%Y-%m-%d_%H%M%S"))
        try:
            self._recorder.start(str(self._folder / name))
        except MrlError:
            with contextlib.suppress(OSError):
                os.unlink(self._folder / name)
            raise
        return name

    def stop(self) -> str:
        return self._recorder.stop()
