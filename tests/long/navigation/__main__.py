"""`python -m tests.long.navigation --source FOLDER` repeats the table of ten goals; `make test-navigation` calls it.

It builds the packages of FOLDER with catkin, starts an emulated robot with them for each robot and world, sends ten
goals, and judges them by ground truth.  It writes build/navigation/table.json.  A run of all takes about an hour.
"""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import List

from mrl_driver.errors import MrlError
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.world import world_file

from .goals import GOALS, LIMIT_S, ROBOTS, Judge, Outcome, row_of, table_of
from .stack import ROOT, Stack, build, require_sources

FOLDER = ROOT / "build" / "navigation"
SERVER_S = 60.0


def ten_goals(robot: str, world: str, setup: Path) -> List[Outcome]:
    """How the goals of a world ended for a robot; runs in a process of its own, because it is a ROS node."""
    scene = world_file.load(world)
    with Stack(robot, world, scene, setup, FOLDER / f"{robot}_{world}"):
        import actionlib
        import rospy
        from move_base_msgs.msg import MoveBaseAction
        from nav_msgs.msg import Odometry

        from ros1_bridge.node.plane_poses import planar

        from .drive import drive

        body = footprint_for(models.load(robot))
        assert body is not None
        judge = Judge(scene, body)
        rospy.init_node("ten_goals", disable_signals=True)
        rospy.Subscriber(
            "base_pose_ground_truth", Odometry, lambda message: judge.see(planar(message.pose.pose))
        )
        client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        if not client.wait_for_server(rospy.Duration(SERVER_S)):
            raise MrlError(f"move_base offers no action after {SERVER_S:g} s, see {FOLDER}/{robot}_{world}")
        return drive(client, judge, GOALS[world], LIMIT_S)


def main(arguments: List[str]) -> int:
    """Run the table; returns the exit code: 1 if a goal was not reached or something was touched."""
    parser = argparse.ArgumentParser(prog="make test-navigation", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--source", required=True, help="folder with the sources of the navigation packages")
    parser.add_argument("--robot", choices=ROBOTS, action="append", help="only this robot; may be repeated")
    parser.add_argument(
        "--world", choices=sorted(GOALS), action="append", help="only this world; may be repeated"
    )
    parser.add_argument("--one", metavar="SETUP", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    robots, worlds = given.robot or ROBOTS, given.world or sorted(GOALS, reverse=True)
    if given.one:  # a ROS node is one in its process
        print(json.dumps(ten_goals(robots[0], worlds[0], Path(given.one))))
        return 0
    require_sources(Path(given.source))
    setup, rows = build(Path(given.source), FOLDER / "workspace"), []
    for robot in robots:
        for world in worlds:
            rows.append(row_of(robot, world, in_own_process(robot, world, setup)))
            print(table_of(rows[-1:]).splitlines()[-1], flush=True)
    (FOLDER / "table.json").write_text(json.dumps(rows, indent=1) + "\n")
    print(table_of(rows))
    return int(any(row["reached"] != row["goals"] or row["contacts"] for row in rows))


def in_own_process(robot: str, world: str, setup: Path) -> List[Outcome]:
    """The same as `ten_goals`: each run has a ROS master of its own."""
    command = [sys.executable, "-m", "tests.long.navigation", "--source", ".", "--one", str(setup)]
    command += ["--robot", robot, "--world", world]
    done = subprocess.run(command, cwd=str(ROOT), stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise MrlError(f"{robot} in {world}: the run failed with exit code {done.returncode}")
    return [Outcome(*values) for values in json.loads(done.stdout.splitlines()[-1])]


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(error.exit_code)
