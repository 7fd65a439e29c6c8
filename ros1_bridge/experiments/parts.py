"""Master, emulated boards and nodes as processes that end with the experiment.  No rospy."""

import os
import signal
import sys
from pathlib import Path
from typing import Dict, List, Optional

from mrl_driver.errors import MrlError
from ros1_bridge.demo.launcher import free_port, master_answers
from ros1_bridge.demo.processes import Child, wait_until

ROOT = Path(__file__).resolve().parent.parent.parent
START_S = 30.0
"""A part that is not there after this has failed; generous, the machine may be busy."""
END_S = 5.0


def environment(folder: str, given: Dict[str, str]) -> Dict[str, str]:
    """`given` with a master of its own on localhost; all that ROS and shared worlds write goes into the folder."""
    return {
        **given,
        "ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": folder,
        "ROS_LOG_DIR": folder,
        "XDG_RUNTIME_DIR": folder,
    }


def end(*children: Child) -> None:
    """Asks programs to end, and makes them."""
    for child in children:
        child.signal(signal.SIGTERM)
    for child in children:
        child.finish(END_S)


class Parts:
    """The programs of an experiment; a context manager that ends them: nodes, then boards, then the master.

    Args:
        folder: Gets logs and ports.
    """

    def __init__(self, folder: str) -> None:
        self.folder = Path(folder)
        self._nodes: List[Child] = []
        self._boards: List[Child] = []
        self._masters: List[Child] = []

    def _start(self, name: str, command: List[str], among: List[Child]) -> Child:
        """Starts a program, with a log."""
        log = self.folder / f"{name.replace('/', '_')}.log"
        child = Child(name, command, log, dict(os.environ), ROOT)
        among.append(child)
        return child

    def master(self) -> None:
        """Starts the master of the environment, and waits for it.

        Raises:
            MrlError: it does not start.
        """
        uri = os.environ["ROS_MASTER_URI"]
        child = self._start("rosmaster", ["rosmaster", "--core", "-p", uri.rsplit(":", 1)[1]], self._masters)
        wait_until(lambda: master_answers(uri) or child.exit_code is not None, START_S)
        self.check()
        if not master_answers(uri):
            raise MrlError(f"no ROS master answers at {uri} after {START_S:g} s; is rosmaster sound?")

    def board(self, name: str, *options: str) -> str:
        """Starts an emulated board; its port, which is there in a moment."""
        port = str(self.folder / f"{name}.port")
        command = [sys.executable, "-m", "sim_arduino.serve.main", "--link", port, "--name", name, *options]
        self._start(f"{name}-board", command, self._boards)
        return port

    def node(self, kind: str, space: str, *names: str, **parameters: object) -> Child:
        """Starts a node of this package in a namespace.

        Args:
            names: Remappings, such as `sonar/front:=heard/front`.
            parameters: Its private parameters.
        """
        given = [
            f"_{key}:={str(value).lower() if isinstance(value, bool) else value}"
            for key, value in parameters.items()
        ]
        node = str(ROOT / "ros1_bridge" / "nodes" / kind)
        command = [sys.executable, node, f"__ns:=/{space}", *names, *given]
        return self._start(f"{space}/{kind}", command, self._nodes)

    def robot(self, name: str, port: str, model: str, rate: int, **parameters: object) -> Child:
        """Starts the robot node of a board, in the robot's namespace and with its frames."""
        return self.node(
            "robot_node",
            name,
            port=port,
            port_timeout=START_S,
            robot=model,
            rate=rate,
            odom_frame=f"{name}/odom",
            base_frame=f"{name}/base_link",
            **parameters,
        )

    def end_nodes(self) -> None:
        """Ends the nodes, all at once."""
        _end_all(self._nodes)

    def check(self) -> None:
        """Raises MrlError when one has died."""
        for child in self._masters + self._boards + self._nodes:
            if child.exit_code is not None:
                raise MrlError(f"{child.name} ended with exit code {child.exit_code}: {_last(child)}")

    def close(self) -> None:
        """Ends them: nodes stop their robots before the boards go, the master goes last."""
        for children in (self._nodes, self._boards, self._masters):
            _end_all(children)

    def __enter__(self) -> "Parts":
        """The parts themselves."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends them."""
        self.close()


def _end_all(children: List[Child]) -> None:
    end(*children)
    children.clear()


def _last(child: Child) -> Optional[str]:
    """The last line that a program said."""
    said = [line for line in child.output() if line.strip()]
    return said[-1].strip() if said else None
