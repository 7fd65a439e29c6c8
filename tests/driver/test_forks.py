"""A program with a driver that forks: the child neither hangs, nor touches the robot, nor keeps the port."""

import os
import subprocess
import sys

import pytest

from tests.waiting import wait_until

BEGINNING = """
import os, select, signal, sys
from mrl_driver.driver import Driver, Options
from mrl_driver.errors import LinkLost

with Driver(sys.argv[1], options=Options(command_timeout_s=None)) as robot:
    robot.drive(0.2, 0.0)
    child = os.fork()
    if not child:
        signal.alarm(10)
"""
LEAVES = """
        sys.exit(7)
"""
DRIVES = """
        try:
            robot.drive(0.1, 0.0)
        except LinkLost as error:
            os._exit(7 if "forked" in str(error) else 8)
"""
DRIVES_ON = """
    status = os.waitpid(child, 0)[1]
    print(status, flush=True)
    while not select.select([sys.stdin], [], [], 0.05)[0]:  # a driver that a busy machine holds up drops its command
        robot.drive(0.2, 0.0)
    sys.stdin.readline()
"""


@pytest.fixture
def run(serve):
    """Starts one of the programs on a fake board, by a URL if one is given; `run.port` is the board's end."""
    started = []

    def start(program, url="{}"):
        start.port = serve()
        command = [sys.executable, "-c", BEGINNING + program, url.format(start.port.path)]
        started.append(subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True))
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("program", [LEAVES, DRIVES])
@pytest.mark.parametrize("url", ["{}", f"spy://{{}}?file={os.devnull}"])
def test_a_child_ends_and_leaves_the_robot_to_its_parent(run, program, url):
    process = run(program + DRIVES_ON, url)
    assert os.WEXITSTATUS(int(process.stdout.readline())) == 7
    wait_until(lambda: run.port.board.speeds == (200, 0))
    process.communicate("\n")
    assert process.returncode == 0 and run.port.board.moves[-1] == (200, 0)
