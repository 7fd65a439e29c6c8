"""The reference for `bench_ros`: a bare rospy loop on a pty, without protocol, driver or checks.

Reads raw, publishes one prepared Odometry and one TFMessage for each frame, whose x is the number of the frame;
writes one frame for each cmd_vel.
"""

import os
import select
import sys
import tty
import warnings

import rospy
from geometry_msgs.msg import TransformStamped, Twist
from nav_msgs.msg import Odometry
from tf2_msgs.msg import TFMessage


def main() -> None:
    rospy.init_node("bare")
    fd = os.open(rospy.get_param("~port"), os.O_RDWR | os.O_NOCTTY)
    tty.setraw(fd)
    warnings.simplefilter("ignore", SyntaxWarning)
    odometry, transform = Odometry(), TransformStamped()
    odometry.header.frame_id, odometry.child_frame_id = "odom", "base_link"
    transform.header.frame_id, transform.child_frame_id = "odom", "base_link"
    odometry.pose.pose.orientation.w = transform.transform.rotation.w = 1.0
    both = TFMessage([transform])
    odometry_out = rospy.Publisher("odom", Odometry, queue_size=None, tcp_nodelay=True)
    transform_out = rospy.Publisher("/tf", TFMessage, queue_size=None, tcp_nodelay=True)

    def drive(message: Twist) -> None:
        speeds = round(message.linear.x * 1000), round(message.angular.z * 1000)
        os.write(fd, b"@11,%d,%de" % speeds)

    rospy.Subscriber("cmd_vel", Twist, drive, queue_size=1, tcp_nodelay=True)
    os.write(fd, b"@18,20e")
    count = 0
    while not rospy.is_shutdown():
        if not select.select([fd], [], [], 0.5)[0]:
            continue
        for _ in range(os.read(fd, 4096).count(b"e")):
            count += 1
            stamp = rospy.Time.now()
            odometry.header.stamp = transform.header.stamp = stamp
            odometry.pose.pose.position.x = transform.transform.translation.x = count
            odometry_out.publish(odometry)
            transform_out.publish(both)
    os.close(fd)


if __name__ == "__main__":
    sys.exit(main())
