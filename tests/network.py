"""Networks for tests with two hosts."""

import shutil
import subprocess

import pytest


def ip(*words: str, within: str = "") -> None:
    """One `ip` command, in the network of the process `within` if one is given."""
    enter = ["nsenter", f"--net=/proc/{within}/ns/net"] if within else []
    subprocess.run([*enter, "ip", *words], check=True)


def lay_cable(robot: str, desk_address: str, robot_address: str) -> None:
    """A cable from this network, the desk's, to that of the process `robot`."""
    ip("link", "add", "desk0", "type", "veth", "peer", "name", "robot0", "netns", robot)
    for device, address, within in (("desk0", desk_address, ""), ("robot0", robot_address, robot)):
        ip("address", "add", f"{address}/24", "dev", device, within=within)
        for name in ("lo", device):
            ip("link", "set", name, "up", within=within)


def own_network():
    """Return the command that enters a network and mounts of its own: as root, or as a user who is root in there.

    Skips the test where the kernel forbids them to root and to users alike, as in an unprivileged container.
    """
    assert shutil.which("ip"), "expected the command ip, of Debian's package iproute2"
    for user in ([], ["--user", "--map-root-user"]):
        command = ["unshare", *user, "--net", "--mount"]
        tried = subprocess.run([*command, "ip", "link", "set", "lo", "up"], capture_output=True, text=True)
        if tried.returncode == 0:
            return command
    return pytest.skip(f"the kernel forbids network namespaces: {tried.stderr.strip()}")
