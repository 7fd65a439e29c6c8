"""`mrl web` as a process on an emulated robot of this process, behind a proxy that can stall."""

import itertools
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import List, Optional

from sim_arduino.world.world import World
from tests.driver.emulator import Emulator
from tests.waiting import PATIENCE_S, wait_until

from .stalling_proxy import StallingProxy

_numbers = itertools.count(1)


class Served:
    """An emulated robot, its server and the proxy between server and browsers, until `close`.

    Attributes:
        robot: The emulated robot; its motor board notes when it was told what.
        proxy: What browsers connect to.
        links: Addresses that the server printed, but with the proxy's port: for driving, and for watching only.
    """

    def __init__(self, folder: Path, *arguments: str, links: int = 1, world: Optional[World] = None) -> None:
        self.robot = Emulator(world=world)
        self._folder, self._arguments, self._links = folder, arguments, links
        self.proxy: StallingProxy
        self.start()

    def start(self) -> None:
        """Starts the server; the proxy stays."""
        command = [sys.executable, "-m", "mrl_driver", "web", "--port", self.robot.path, *self._arguments]
        self._log = self._folder / f"web{next(_numbers)}.log"
        with open(self._log, "wb") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log, cwd=str(self._folder))
        printed = wait_until(self._printed, what="the server's address")
        port = int(re.findall(r":(\d+)/", printed[0])[0])
        if hasattr(self, "proxy"):
            self.proxy.target = port
        else:
            self.proxy = StallingProxy(port)
        self.links = [re.sub(r"://[^/]*/", f"://127.0.0.1:{self.proxy.port}/", link) for link in printed]

    def _printed(self) -> List[str]:
        """The addresses in what the server printed, once all are there: one, or that to drive and that to watch."""
        said = self._log.read_text()
        assert self.process.poll() is None, said
        found = re.findall(r"https?://\S+:\d+/#(?:drive|watch)=\w+\b", said)
        kinds = {link.partition("#")[2][:5]: link for link in found}
        if self._links == 1:
            return re.findall(r"http://\S+:\d+/", said)
        return [kinds["drive"], kinds["watch"]] if len(kinds) == 2 else []

    def signal(self, number: int) -> None:
        """Sends a signal to the server."""
        self.process.send_signal(number)

    def close(self) -> None:
        """Ends the server, then the robot."""
        ended = self.process.poll()
        try:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            self.process.wait(PATIENCE_S)
        finally:
            self.process.kill()
            self.process.wait()
            self.proxy.close()
            self.robot.close()
        assert ended is None, f"the server ended with {ended}: {self._log.read_text()}"
