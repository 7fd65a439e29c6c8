"""What the Makefile installs, with stand-ins for Debian's package tools."""

import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOLS = {
    "dpkg-query": "exit 1",
    "sudo": 'exec "$@"',
    "dpkg": '[ "$*" = "--configure -a" ] && rm -f "$PLACE/interrupted"',
    "apt-get": '[ ! -e "$PLACE/interrupted" ] || exit 100\necho "apt-get $*: 1 newly installed"',
}
"""No package is installed; apt-get refuses until dpkg has completed what was interrupted."""


@pytest.fixture
def make(tmp_path):
    """Runs make with these tools; returns what it prints."""
    for name, script in TOOLS.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)

    def call(*words):
        env = {**os.environ, "PLACE": str(tmp_path), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
        done = subprocess.run(["make", *words], cwd=ROOT, env=env, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return call


def test_set_up_completes_an_interrupted_installation_first(make, tmp_path):
    (tmp_path / "interrupted").touch()
    assert "apt-get install -yq" in make("apt")
