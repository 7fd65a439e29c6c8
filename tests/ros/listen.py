"""`python listen.py SECONDS`: a node that prints what a clean run must not have, and counts odom.

Lines: `rosout ...` for each warning and error, `odom N` at the end; tf2 itself tells of repeated data.
"""

import sys

import rospy
import tf2_ros
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Log


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def heed(message: Log) -> None:
    if message.level >= Log.WARN:
        say(f"rosout {message.name}: {message.msg}")


def main(seconds: float) -> None:
    rospy.init_node("listen")
    seen = []
    rospy.Subscriber("/rosout_agg", Log, heed)
    rospy.Subscriber("odom", Odometry, seen.append)
    listener = tf2_ros.TransformListener(tf2_ros.Buffer())
    rospy.wait_for_message("odom", Odometry, 60.0)
    say("ready")
    rospy.sleep(seconds)
    say(f"odom {len(seen)}")
    del listener


if __name__ == "__main__":
    main(float(sys.argv[1]))
