"""Cancels the goals of planners that drive this robot: move_base, `go_to_goal`, and tours of `follow_waypoints`."""

import contextlib
from typing import Any

from actionlib_msgs.msg import GoalID
from genpy import Time

from ros1_bridge.topics.fast_publisher import direct_publisher


class GoalCancel:
    """Publishes `move_base/cancel`; any thread may call it.

    The last message has a time, and is latched: a planner that connects later cancels the goals of before it, and takes
    new ones.  At first, it cancels those of before this node's start.  `ros` is the module rospy.
    """

    def __init__(self, ros: Any) -> None:
        self._ros = ros
        self._out = direct_publisher(ros.Publisher, "move_base/cancel", GoalID, latch=True)
        self.cancel(everything=False)

    def cancel(self, everything: bool) -> None:
        """Cancel all goals, also those of a client whose clock is ahead; or those of before this moment alone."""
        self._at = self._ros.Time.now()
        with contextlib.suppress(self._ros.ROSException):  # the shutdown has closed the topic
            if everything:
                self._out.publish(GoalID())
            if self._at:  # with the time 0, before the first message of /clock, it would cancel all
                self._out.publish(GoalID(stamp=self._at))

    def set_back(self, back_s: float) -> None:
        """Give the last message its time by a clock that was set back by `back_s` [s], for planners that connect later.

        No goal that was sent after the last cancel is cancelled.
        """
        self._at = Time.from_sec(max(self._at.to_sec() - back_s, 1e-9))  # the time 0 would cancel all
        with contextlib.suppress(self._ros.ROSException):
            self._out.publish(GoalID(stamp=self._at))
