"""Nodes of `bench_relay`, each on a master of its own: `talk` publishes odometry, `listen` prints when it arrived.

    python -m tests.long.bench.relay_ends talk TOPIC HZ
    python -m tests.long.bench.relay_ends listen TOPIC SECONDS

`listen` prints a list of [time of arrival since the first one, delay], both in seconds, as JSON.  All run on one
machine, so that stamps and arrivals have the same clock.
"""

import json
import sys
import time
from typing import List, Tuple

import rospy
from nav_msgs.msg import Odometry


def talk(topic: str, hz: float) -> None:
    out = rospy.Publisher(topic, Odometry, queue_size=10, tcp_nodelay=True)
    message, rate = Odometry(child_frame_id="base_link"), rospy.Rate(hz)
    while not rospy.is_shutdown():
        message.header.stamp = rospy.Time.from_sec(time.time())
        out.publish(message)
        rate.sleep()


def listen(topic: str, seconds: float) -> None:
    """Note what arrives within `seconds` after the first message."""
    arrived: List[Tuple[float, float]] = []

    def take(message: Odometry) -> None:
        arrived.append((time.time(), time.time() - message.header.stamp.to_sec()))

    rospy.Subscriber(topic, Odometry, take, tcp_nodelay=True)
    while not arrived or time.time() < arrived[0][0] + seconds:
        time.sleep(0.05)
    found = list(arrived)
    print(json.dumps([(at - found[0][0], delay) for at, delay in found]))


def main() -> None:
    rospy.init_node(sys.argv[1], anonymous=True)
    (talk if sys.argv[1] == "talk" else listen)(sys.argv[2], float(sys.argv[3]))


if __name__ == "__main__":
    main()
