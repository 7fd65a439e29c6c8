"""The robot node with `CallLists` installed; at its end it writes the steps that end at a socket or a port, in JSON.

python3 -m tests.ros.profiled_node STEPS_FILE [ROS ARGUMENTS...]
"""

import json
import sys
from pathlib import Path

from ros1_bridge.robot import robot_node
from tests.call_lists import CallLists

READ = "mrl_driver/transport/link.py:read"
COMMAND = "ros1_bridge/robot/robot_node.py:_on_cmd_vel"
PUBLISH = "ros1_bridge/topics/fast_publisher.py:write_or_drop"
MOVED = "mrl_driver/geometry.py:advance"
WRITE = "mrl_driver/transport/link.py:write"


def main() -> int:
    """Run the node, and write the steps."""
    path = Path(sys.argv.pop(1))
    lists = CallLists(READ, COMMAND).install()
    try:
        return robot_node.main(sys.argv)
    finally:
        lists.remove()
        frames = [step for step in lists.steps if step.calls[0] == READ and PUBLISH in step.calls]
        standing = [step for step in frames if MOVED not in step.calls]
        driving = [step for step in frames if MOVED in step.calls]
        commands = [step for step in lists.steps if step.calls[0] == COMMAND and WRITE in step.calls]
        path.write_text(json.dumps({"standing": standing, "driving": driving, "commands": commands}))


if __name__ == "__main__":
    sys.exit(main())
