"""Looks up once in tf where the laser is mounted on the robot.  Imports no ROS before the first scan."""

import math
from typing import Any, Optional

from mrl_driver.errors import one_line
from mrl_driver.geometry import Pose
from mrl_driver.yaml_file import short

from .zone_feed import mount_of


class MountFinder:
    """Listens to tf from the first call until the mount is known; a mount does not change."""

    def __init__(self, base_frame: str) -> None:
        self._base = base_frame
        self._buffer: Any = None
        self._listener: Any = None
        self._mount: Optional[Pose] = None
        self._frame = ""
        self.trouble = ""
        """Why the mount is not known."""

    def mount(self, frame: str) -> Optional[Pose]:
        """x, y, yaw of `frame` in base_frame [m m rad].

        None if it is unknown, or if the first scan had another frame; `trouble` says why.
        """
        if self._mount is None:
            self._look(frame)
        elif frame != self._frame:
            expected = f"expected {short(self._frame)} as before: the zones watch one laser"
            self.trouble = f"it is in frame {short(frame)}, {expected}"
            return None
        return self._mount

    def _look(self, frame: str) -> None:
        import tf2_ros  # late: most robots have no laser, and their node does not load tf
        from genpy import Time

        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
        try:
            found = self._buffer.lookup_transform(self._base, frame, Time())
            mount = mount_of(found.transform)
            if not all(map(math.isfinite, mount)):
                raise ValueError(f"tf has it at {mount}, expected finite numbers")
        except (tf2_ros.TransformException, ValueError) as error:
            self.trouble = f"frame {short(frame)} has no place on the robot: {one_line(str(error))}"
            return
        self._mount, self._frame = mount, frame
        self._listener.unregister()
        self._listener = None
