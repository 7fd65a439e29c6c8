"""Networks for tests with two hosts."""

import subprocess

import pytest


def own_network():
    """Return the command that enters a network and mounts of its own: as root, or as a user who is root in there.

    Skips the test where the kernel forbids them to root and to users alike, as in an unprivileged container.
    """
    for user in ([], ["--user", "--map-root-user"]):
        command = ["unshare", *user, "--net", "--mount"]
        tried = subprocess.run([*command, "ip", "link", "set", "lo", "up"], capture_output=True, text=True)
        if tried.returncode == 0:
            return command
    return pytest.skip(f"the kernel forbids network namespaces: {tried.stderr.strip()}")
