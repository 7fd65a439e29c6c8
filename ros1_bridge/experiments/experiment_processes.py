"""Master, emulated boards and nodes as processes that end with the experiment.  No rospy."""

import os
import signal
import sys
from pathlib import Path
from typing import ContextManager, Dict, List

from mrl_driver.errors import MrlError
from ros1_bridge.demo.launcher import free_port
from ros1_bridge.demo.processes import Child, wait_until

ROOT = Path(__file__).resolve().parent.parent.parent
START_S = 30.0
"""A part that has not started after this time has failed; generous, because the machine may be busy."""
END_S = 5.0


def environment(folder: str, given: Dict[str, str]) -> Dict[str, str]:
    """`given` with its own master on localhost; ROS and shared worlds write all their files into the folder."""
    return {
        **given,
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": folder,
        "ROS_LOG_DIR": folder,
        "XDG_RUNTIME_DIR": folder,
    }


def end(*children: Child) -> None:
    """Ask programs to end, and kill those that do not."""
    for child in children:
        child.signal(signal.SIGTERM)
    for child in children:
        child.finish(END_S)


class Parts(ContextManager["Parts"]):
    """The programs of an experiment, with their logs in a folder; at its end the nodes end first, the master last."""

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self._nodes: List[Child] = []
        self._boards: List[Child] = []
        self._masters: List[Child] = []

    def _start(self, name: str, command: List[str], among: List[Child]) -> Child:
        """Starts a program with a log."""
        log = self.folder / f"{name.replace('/', '_')}.log"
        among.append(Child(name, command, log, dict(os.environ), ROOT))
        return among[-1]

    def master(self) -> None:
        """Starts the ROS master that the environment names, and waits for it; MrlError if it does not start."""
        from rosgraph.masterapi import is_online

        uri = os.environ["ROS_MASTER_URI"]
        child = self._start("rosmaster", ["rosmaster", "--core", "-p", uri.rsplit(":", 1)[1]], self._masters)
        wait_until(lambda: is_online(uri) or child.exit_code is not None, START_S)
        self.check()
        if not is_online(uri):
            raise MrlError(f"no ROS master answers at {uri} after {START_S:g} s; is rosmaster sound?")

    def node(self, kind: str, space: str, *names: str, **parameters: object) -> Child:
        """Starts a node of this package in a namespace.

        Args:
            kind: Name of the node's executable, such as `robot_node`.
            space: Namespace, without the leading slash.
            names: Remappings, such as `sonar/front:=heard/front`.
            parameters: Private parameters of the node.
        """
        given = [
            f"_{key}:={str(value).lower() if isinstance(value, bool) else value}"
            for key, value in parameters.items()
        ]
        node = str(ROOT / "ros1_bridge" / "nodes" / kind)
        command = [sys.executable, node, f"__ns:=/{space}", *names, *given]
        return self._start(f"{space}/{kind}", command, self._nodes)

    def robot(self, name: str, model: str, rate: int, *options: str) -> None:
        """Starts a board with options of `mrl-sim`, and its robot node in the robot's namespace and frames."""
        port = str(self.folder / f"{name}.port")
        command = [sys.executable, "-m", "sim_arduino.serve.main", "--link", port, "--name", name]
        self._start(f"{name}-board", [*command, "--robot", model, *options], self._boards)
        frames = {"odom_frame": f"{name}/odom", "base_frame": f"{name}/base_link"}
        self.node("robot_node", name, port=port, port_timeout=START_S, robot=model, rate=rate, **frames)

    def check(self) -> None:
        """Raises MrlError if a program has ended."""
        for child in self._masters + self._boards + self._nodes:
            if child.exit_code is not None:
                raise MrlError(child.last_words())

    def close(self) -> None:
        """Ends all programs: first the nodes, which stop their robots, then the boards, then the master."""
        for children in (self._nodes, self._boards, self._masters):
            end(*children)
            children.clear()

    def __exit__(self, *_: object) -> None:
        """Ends all programs."""
        self.close()
