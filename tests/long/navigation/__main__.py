"""`python -m tests.long.navigation`, `make test-navigation`: ten goals a run with the real navigation packages.

It starts an emulated robot with them for each robot, world and kind of sensors, and judges the goals by ground truth.
It writes build/navigation/table.json after each run, and continues there: delete the file to begin again.  A run of all
takes about two hours.  With KEEP=1 its figures go to docs/figures.  `--busy 0.5` keeps each core half busy meanwhile.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from multiprocessing import Process
from typing import Any, Dict, Iterator, List, Sequence

from mrl_driver.errors import MrlError
from mrl_driver.robot import models
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.world import world_file
from tests.long.bench import report

from .goals import GOALS, LIMIT_S, ROBOTS, SENSORS, Judge, Outcome, figures_of, row_of, table_of
from .stack import ROOT, Stack, end_with, packages_for, require_packages

FOLDER = ROOT / "build" / "navigation"
TABLE = FOLDER / "table.json"
SERVER_S = 60.0
BUSY_PERIOD_S = 0.1


def keep_busy(core: int, share: float) -> None:
    """Compute for this share of the time of a core."""
    os.sched_setaffinity(0, {core})
    while True:
        until_s, due_s = time.process_time() + share * BUSY_PERIOD_S, time.monotonic() + BUSY_PERIOD_S
        while time.process_time() < until_s:
            pass
        time.sleep(max(0.0, due_s - time.monotonic()))


@contextmanager
def busy(share: float) -> Iterator[None]:
    """All cores are busy for this share of the time."""
    cores = os.sched_getaffinity(0) if share else ()
    loops = [Process(target=keep_busy, args=(core, share), daemon=True) for core in cores]
    for loop in loops:
        loop.start()
    try:
        yield
    finally:
        for loop in loops:
            loop.terminate()


def ten_goals(robot: str, world: str, arguments: Sequence[str]) -> List[Outcome]:
    """How the goals of a world ended for a robot; runs in a process of its own, because it is a ROS node."""
    scene = world_file.load(world)
    folder = FOLDER / "_".join((robot, world, *arguments)).replace(":=", "_")
    with Stack(robot, world, scene, folder, arguments):
        import actionlib
        import rospy
        from move_base_msgs.msg import MoveBaseAction, RecoveryStatus
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
        rospy.Subscriber("move_base/recovery_status", RecoveryStatus, lambda _: judge.recover())
        client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
        if not client.wait_for_server(rospy.Duration(SERVER_S)):
            raise MrlError(f"move_base offers no action after {SERVER_S:g} s, see {folder}")
        return drive(client, judge, GOALS[world], LIMIT_S)


def main(arguments: List[str]) -> int:
    """Run the table; returns the exit code: 1 if a goal was not reached or something was touched."""
    parser = argparse.ArgumentParser(prog="make test-navigation", description=(__doc__ or "").splitlines()[0])
    for name, choices in (("robot", ROBOTS), ("world", sorted(GOALS)), ("sensors", SENSORS)):
        text = f"only this {name}; may be repeated"
        parser.add_argument(f"--{name}", choices=choices, action="append", help=text)
    parser.add_argument(
        "--with", dest="more", default=[], nargs="+", help="arguments of navigation.launch, NAME:=VALUE"
    )
    parser.add_argument(
        "--busy", type=float, default=0.0, help="share of each core that a loop takes, such as 0.5"
    )
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args(arguments)
    robots, worlds, sensors = given.robot or ROBOTS, given.world or sorted(GOALS), given.sensors or SENSORS
    if given.one:
        print(json.dumps(ten_goals(robots[0], worlds[0], (f"sensors:={sensors[0]}", *given.more))))
        return 0
    for kind in sensors:
        require_packages(packages_for(kind))
    FOLDER.mkdir(parents=True, exist_ok=True)
    rows: List[Dict[str, object]] = json.loads(TABLE.read_text()) if TABLE.exists() else []
    with busy(given.busy):
        for values in itertools.product(sensors, worlds, robots):
            run = dict(zip(("sensors", "world", "robot"), values), more=" ".join(given.more), busy=given.busy)
            if not any(run.items() <= row.items() for row in rows):
                rows.append(row_of(run, in_own_process(run, given.more)))
                TABLE.write_text(json.dumps(rows, indent=1) + "\n")
                print(table_of(rows[-1:]).splitlines()[-1], flush=True)
    print(table_of(rows))
    report.conclude("navigation", {key: value for row in rows for key, value in figures_of(row).items()})
    return int(any(row["reached"] != row["goals"] or row["contacts"] for row in rows))


def in_own_process(run: Dict[str, Any], more: Sequence[str]) -> List[Outcome]:
    """The same as `ten_goals`: each run has a ROS master of its own."""
    command = [sys.executable, "-m", "tests.long.navigation", "--one"]
    for name in ("robot", "world", "sensors"):
        command += [f"--{name}", run[name]]
    command += ["--with", *more] if more else []
    done = subprocess.run(command, cwd=str(ROOT), stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise MrlError(f"{' '.join(map(str, run.values()))}: the run failed with exit code {done.returncode}")
    return [Outcome(*values) for values in json.loads(done.stdout.splitlines()[-1])]


if __name__ == "__main__":
    end_with(main)
