"""On Noetic nodes run on the system's packages: click is too old there, rich is missing."""

from nav_msgs.msg import Odometry

HIDE = "import sys\n" + "".join(
    f"sys.modules[{name!r}] = None\n" for name in ("click", "platformdirs", "rich")
)


def test_robot_node_drives_on_system_packages_alone(rig, tmp_path):
    """It cannot import what comes by pip."""
    port, odometry = rig.board().port, rig.topic("odom", Odometry)
    (tmp_path / "sitecustomize.py").write_text(HIDE)
    rig.env = {**rig.env, "PYTHONPATH": f"{tmp_path}:{rig.env.get('PYTHONPATH', '')}"}
    rig.node(port)
    odometry.wait()
    rig.drive_until(lambda: odometry.messages[-1].pose.pose.position.x > 0.02)
