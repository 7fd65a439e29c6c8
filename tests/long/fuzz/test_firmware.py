"""A short search for bytes that hurt, and the golden vectors and what it found again under gcc's sanitizers."""

import subprocess
from pathlib import Path

import pytest

from tests.firmware.pc_board import BUILD
from tests.vectors import load
from tests.waiting import PATIENCE

RUNS = 1000
IMAGES = ("", "_hbridge")


def run(*command) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run(
        [str(part) for part in command], capture_output=True, check=False, timeout=120 * PATIENCE
    )


def seeds(folder: Path) -> Path:
    """The golden vectors, amid events of the world."""
    folder.mkdir(exist_ok=True)
    for number, vector in enumerate(load("requests")):
        (folder / str(number)).write_bytes(vector.wire + b"\xf4\xf0\xf4" + vector.wire + b"\xf1\xf5\xf2")
    return folder


@pytest.mark.parametrize("image", IMAGES)
def test_fuzzer_finds_nothing(tmp_path, image):
    corpus = seeds(tmp_path / "corpus")
    found = run(
        BUILD / f"fuzz_firmware{image}",
        f"-runs={RUNS}",
        "-seed=1",
        "-max_len=256",
        f"-artifact_prefix={tmp_path}/",
        corpus,
    )
    assert found.returncode == 0, found.stderr.decode()[-2000:]
    checked = run(BUILD / f"checked_firmware{image}", *sorted(corpus.iterdir()))
    assert checked.returncode == 0, checked.stderr.decode()[-2000:]
