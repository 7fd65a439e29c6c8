"""`mrl web`: the command around the page's server."""

import contextlib
import http.client
import os
import signal
import socket
import subprocess
import sys
from urllib.parse import urlsplit

from mrl_driver.host import access
from sim_arduino.testing import EmulatedBoard
from tests.cli.conftest import _alone  # noqa: F401
from tests.cli.run import fails, mrl
from tests.waiting import PATIENCE_S

ANYWHERE = "/dev/ttyACM0"


class Running:
    """`mrl web` as a process on an emulated robot of this one."""

    def __init__(self, *words):
        self.board = EmulatedBoard("square")
        command = [sys.executable, "-m", "mrl_driver", "web", "--port", self.board.port, *words]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=dict(os.environ)
        )
        self.line = self.process.stdout.readline()
        assert self.line, self.process.stderr.read()

    def get(self, path):
        """Status and text of a page."""
        link = http.client.HTTPConnection(urlsplit(self.line.split()[0]).netloc, timeout=PATIENCE_S)
        link.request("GET", path)
        answer = link.getresponse()
        found = answer.status, answer.read().decode()
        link.close()
        return found

    def close(self):
        self.process.kill()
        self.process.communicate()
        self.board.close()


def test_the_page_is_served_while_the_port_is_lost_and_until_a_signal():
    """One process for both facts: each takes a second of the processor to start."""
    running = Running("--listen", "127.0.0.1:0")
    with contextlib.closing(running):
        assert running.line.startswith("http://127.0.0.1:") and "traxbot 1" in running.line
        assert running.get("/")[0] == 200
        running.board.faults.unplug()
        assert "the port is searched" in running.process.stderr.readline()
        assert running.get("/")[0] == 200
        running.process.send_signal(signal.SIGINT)
        _, said = running.process.communicate(timeout=PATIENCE_S)
        assert (running.process.returncode, said.strip()) == (130, "mrl: interrupted")


def test_an_address_in_use_is_refused_before_the_robot_is_touched():
    with socket.create_server(("127.0.0.1", 0)) as other:
        address = f"127.0.0.1:{other.getsockname()[1]}"
        assert f"{address} is in use" in fails(5, "web", "--port", ANYWHERE, "--listen", address)


def test_new_tokens_are_not_made_if_the_address_is_in_use():
    before = access.tokens()
    with socket.create_server(("0.0.0.0", 0)) as other:
        address = f"0.0.0.0:{other.getsockname()[1]}"
        assert "in use" in fails(5, "web", "--port", ANYWHERE, "--listen", address, "--new-tokens")
    assert access.tokens() == before


def test_a_link_with_a_token_goes_into_no_list_of_processes():
    said = fails(2, "web", "--port", ANYWHERE, "--listen", "0.0.0.0", "--browser")
    assert "open the link that is printed" in said


def test_a_port_that_cannot_be_opened_yet_is_waited_for():
    done = mrl("web", "--port", "/dev/nowhere", "--listen", "127.0.0.1:0", "--port-timeout", "0.1")
    first, last = done.stderr.splitlines()
    assert done.returncode == 3 and "the port is tried again" in first and "[port_missing]" in last


def test_a_port_that_is_not_there():
    assert "/dev/nowhere" in fails(3, "web", "--port", "/dev/nowhere", "--listen", "127.0.0.1:0")


def test_a_page_beyond_this_computer_has_a_link_to_drive_and_one_to_watch():
    from mrl_driver.apps.web import listening

    settings = listening.settings_for("0.0.0.0:0")
    drive, *others = listening.lines_for(settings, 99, picture=True)
    assert settings.context is not None and drive.endswith(f":99/#drive={settings.tokens.drive}")
    assert len(others) > 10, "a QR code"


def test_new_tokens_count_for_a_server_that_runs():
    from mrl_driver.apps.web import listening

    settings = listening.settings_for("0.0.0.0:0")
    assert settings.renewed() is None
    assert access.tokens(renew=True) == settings.renewed()
