"""A short search for bytes that hurt, and what it found again under gcc's sanitizers."""

import subprocess
from pathlib import Path

from tests.firmware.pc_board import BUILD
from tests.vectors import load

RUNS = 4000


def run(*command) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run([str(part) for part in command], capture_output=True, check=False, timeout=120)


def seeds(folder: Path) -> Path:
    """The golden vectors, amid events of the world."""
    folder.mkdir()
    for number, vector in enumerate(load("requests")):
        (folder / str(number)).write_bytes(vector.wire + b"\xf4\xf0\xf4" + vector.wire + b"\xf1\xf2")
    return folder


def test_fuzzer_finds_nothing(tmp_path):
    corpus = seeds(tmp_path / "corpus")
    found = run(
        BUILD / "fuzz_firmware",
        f"-runs={RUNS}",
        "-seed=1",
        "-max_len=256",
        f"-artifact_prefix={tmp_path}/",
        corpus,
    )
    assert found.returncode == 0, found.stderr.decode()[-2000:]
    checked = run(BUILD / "checked_firmware", *sorted(corpus.iterdir()))
    assert checked.returncode == 0, checked.stderr.decode()[-2000:]


def test_golden_vectors_under_the_sanitizers(tmp_path):
    checked = run(BUILD / "checked_firmware", *sorted(seeds(tmp_path / "corpus").iterdir()))
    assert checked.returncode == 0, checked.stderr.decode()[-2000:]
