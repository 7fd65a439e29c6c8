"""ROS node `environment_map`: alcohol, dust and heat as coloured cells over the map, with a legend, for rviz.

Each reading is drawn where the robot is, in a cell of a grid in the frame of the map: from the first threshold on
small and pale, from the second one large.  The sensors' messages have no stamps, so the pose is that of their arrival.
All cells are published again when one has changed, in one message that is latched: a late rviz sees all.
"""

import contextlib
import math
import threading
import time
from collections import Counter
from typing import Any, Dict, List, Sequence, Tuple

import rospy
import tf2_ros
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from mrl_driver.errors import ConfigError, one_line
from mrl_driver.view.environment_cells import CELL_M, SHOWN, VARIABLES, Cells, Variable
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.plane_poses import transform_pose
from ros1_bridge.node.run_node import node
from ros1_bridge.topics import sensor_topics

PERIOD_S, TF_TIMEOUT_S, WARN_EVERY_S = 0.5, 0.5, 5.0
PALE, SMALL, LETTER_M, HEIGHT_M = 0.6, 0.7, 0.16, 0.01
_WHITE = (1.0, 1.0, 1.0)
PARAMETERS = (
    Row("map_frame", str, "map", "", "Frame of the cells"),
    Row("base_frame", str, "base_link", "", "Frame of the robot"),
    Row("cell", float, CELL_M, "m", "Size of a cell", 0.05, 5.0),
    Row("show", str, SHOWN[0], "", "Reading that a cell shows", choices=SHOWN),
    Row("legend_x", float, 0.0, "m", "Left end of the legend in the map", -1000.0, 1000.0),
    Row("legend_y", float, -0.4, "m", "Its upper end", -1000.0, 1000.0),
    *(
        Row(f"{v.title}_{name}", float, value, v.unit, f"Cells from here on are {how}", v.low, v.high)
        for v in VARIABLES
        for name, value, how in (("notice", v.notice, "pale"), ("alert", v.alert, "full"))
    ),
)
"""The node's private parameters."""


def variables_of(given: Dict[str, Any]) -> List[Variable]:
    """The variables with the thresholds of the parameters; ConfigError if two are in the wrong order."""
    made = []
    for each in VARIABLES:
        notice, alert = (given[f"{each.title}_{name}"] for name in ("notice", "alert"))
        if not notice < alert:
            raise ConfigError(
                f"parameter {each.title}_alert is {alert:g}, expected more than {each.title}_notice, {notice:g}"
            )
        made.append(each._replace(notice=notice, alert=alert))
    return made


class EnvironmentMap:
    """The cells of one robot."""

    def __init__(self, given: Dict[str, Any]) -> None:
        self._map, self._base, self._size_m = given["map_frame"], given["base_frame"], given["cell"]
        self._show, self._legend = given["show"], (given["legend_x"], given["legend_y"])
        self._variables = variables_of(given)
        self._lock = threading.Lock()  # guards the next lines
        self._refused: Dict[str, int] = Counter()
        self._newest = rospy.Time()
        self._cells = self._no_cells()
        self._changed = True
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._out = rospy.Publisher("environment_map", MarkerArray, queue_size=1, latch=True)
        for topic, entry in sensor_topics.load().items():
            for each in self._variables:
                if each.sensor == entry.sensor:
                    kind = sensor_topics.KINDS[entry.type].message
                    rospy.Subscriber(topic, kind, self._on_reading, (each, entry.factor), queue_size=1)

    def _no_cells(self) -> Dict[str, Cells]:
        return {each.title: Cells(self._size_m, self._show) for each in self._variables}

    def run(self) -> None:
        """Publish until the shutdown."""
        while not rospy.is_shutdown():
            with self._lock:
                markers, self._changed = self._markers() if self._changed else [], False
            if markers:
                self._out.publish(MarkerArray(markers))
            time.sleep(PERIOD_S)

    def _on_reading(self, message: Any, of: Tuple[Variable, float]) -> None:
        variable, factor = of
        try:
            stamp = rospy.Time.now()
            if not stamp:
                raise ValueError("the clock is 0, expected one that runs; play a bag with --clock")
            self._begin_again_if_back(stamp)
            data = getattr(message, "data", ())
            fields = data if isinstance(data, Sequence) else (data,)
            value = variable.value([each / factor for each in fields])
            found = self._buffer.lookup_transform(self._map, self._base, stamp, rospy.Duration(TF_TIMEOUT_S))
            pose = transform_pose(found.transform)
            with self._lock:
                if stamp <= self._newest:  # else the clock has jumped back meanwhile
                    self._cells[variable.title].put(pose.x_m, pose.y_m, value)
                    self._changed = True
        except tf2_ros.TransformException as error:
            self._forget_later(stamp)
            self._warn("pose", one_line(str(error)))
        except (ValueError, OverflowError) as error:
            self._warn(variable.title, str(error))

    def _begin_again_if_back(self, stamp: rospy.Time) -> None:
        """A simulated clock that jumps back is that of a bag that begins again, with poses and readings of its own."""
        with self._lock:
            back = stamp + rospy.Duration(TF_TIMEOUT_S) < self._newest and not rospy.rostime.is_wallclock()
            self._newest = stamp if back else max(stamp, self._newest)
            if back:
                self._cells, self._changed = self._no_cells(), True
        if back:
            self._warn("clock", "it jumped back, and the map begins again")

    def _forget_later(self, stamp: rospy.Time) -> None:
        """Poses from before a jump of the clock may arrive after it; with them tf refuses those of now as old."""
        with contextlib.suppress(tf2_ros.TransformException):
            newest = self._buffer.get_latest_common_time(self._map, self._base)
            if newest > stamp + rospy.Duration(TF_TIMEOUT_S):
                self._buffer.clear()

    def _warn(self, what: str, why: str) -> None:
        with self._lock:
            self._refused[what] += 1
            count = self._refused[what]
        text = f"{what}: {why} ({count} so far)"
        if count == 1:
            rospy.logwarn(text)
        else:
            rospy.logwarn_throttle(WARN_EVERY_S, text)

    # -- markers

    def _markers(self) -> List[Marker]:
        left, top = self._legend
        part_m = self._size_m / 3
        made = [self._text("legend", self._legend, f"cells of {self._size_m:g} m, {self._show} reading")]
        for line, each in enumerate(self._variables, 1):
            levels = (
                ("notice", PALE, SMALL, each.notice, each.alert),
                ("alert", 1.0, 1.0, each.alert, math.inf),
            )
            for column, (name, opacity, size, low, high) in enumerate(levels):
                x, y = left + 12 * LETTER_M * column, top - 1.5 * LETTER_M * line
                places = self._cells[each.title].between(low, high)
                squares = self._marker(f"{each.title} {name}", Marker.CUBE_LIST, _rgb(each.colour), opacity)
                squares.points = [Point(at[0] + each.third * part_m, at[1], HEIGHT_M) for at in places]
                squares.points.append(Point(x, y, HEIGHT_M))
                squares.scale.x, squares.scale.y, squares.scale.z = (
                    size * part_m,
                    size * 2.5 * part_m,
                    HEIGHT_M,
                )
                text = f"{each.title} {low:g} {each.unit}"
                made += [squares, self._text(f"{each.title} {name} legend", (x + LETTER_M, y), text)]
        return made

    def _text(self, name: str, left: Tuple[float, float], words: str) -> Marker:
        """A text that begins about there: rviz puts its middle at the position."""
        text = self._marker(name, Marker.TEXT_VIEW_FACING, _WHITE, 1.0)
        text.text, text.scale.z = words, LETTER_M
        text.pose.position.x, text.pose.position.y = left[0] + 0.22 * LETTER_M * len(words), left[1]
        return text

    def _marker(self, name: str, kind: int, colour: Tuple[float, ...], opacity: float) -> Marker:
        marker = Marker(ns=name, type=kind, color=ColorRGBA(*colour, opacity))
        marker.header.frame_id, marker.pose.orientation.w = self._map, 1.0
        return marker


def _rgb(colour: str) -> Tuple[float, ...]:
    """Red, green and blue of #rrggbb, from 0 to 1."""
    return tuple(int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))


main = node("environment_map", PARAMETERS, lambda given: EnvironmentMap(given).run())
