"""A disk that is full: what was there stays, and what is missing is said, with exit code 15."""

import os
import stat

import pytest

from mrl_driver import figures
from mrl_driver.errors import OutputError
from mrl_driver.files import replace_file

from .run import mrl
from .terminal import Terminal, on_a_full_disk
from .test_plot import recorded  # noqa: F401

FULL = OutputError.exit_code


@pytest.mark.parametrize(
    "command",
    [
        ("record", "--seconds", "1.2", "/dev/full"),
        ("monitor", "--seconds", "1.2", "--record", "/dev/full"),
        ("drive", "--linear", "0.1", "--for", "0.6", "--record", "/dev/full"),
    ],
    ids=lambda words: words[0],
)
def test_a_recording_that_lacks_lines_has_its_exit_code(serve, command):
    done = mrl(*command, "--port", serve().path)
    assert done.returncode == FULL
    assert "mrl: /dev/full lacks " in done.stderr and "No space left on device" in done.stderr


def test_the_live_view_says_that_the_recording_is_incomplete(serve):
    terminal = Terminal("record", "--port", serve().path, "/dev/full")
    try:
        terminal.answer("INCOMPLETE", "q")
        terminal.answer("No space left on device", "q")
    finally:
        code = terminal.end()
    assert code == FULL


def test_an_old_picture_stays(recorded):  # noqa: F811
    picture = recorded.with_suffix(".png")
    picture.write_bytes(b"old")
    figures.figure(2, 2)  # the first on a machine looks for fonts, which takes long and is kept in a file
    done = on_a_full_disk(4096, "mrl_driver", "plot", recorded)
    assert done.returncode == FULL and done.stderr.count("\n") == 1, done.stderr
    assert f"{picture} cannot be written: File too large; nothing was changed" in done.stderr
    assert picture.read_bytes() == b"old" and not list(recorded.parent.glob(".mrl-*"))


# -- files that are replaced


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.yaml").write_text("old")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    replace_file(str(tmp_path / "link.yaml"), "new")
    assert (tmp_path / "link.yaml").is_symlink() and (tmp_path / "real.yaml").read_text() == "new"


def test_no_other_file_is_written_on_the_way(tmp_path):
    """In a folder such as /tmp, another user may have guessed a name and made a link of it."""
    kept = tmp_path / "kept"
    kept.write_text("kept")
    (tmp_path / f"robot.yaml.{os.getpid()}.new").symlink_to(kept)
    replace_file(str(tmp_path / "robot.yaml"), "new")
    assert kept.read_text() == "kept"


def test_permissions_stay(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("old")
    path.chmod(0o640)
    replace_file(str(path), "new")
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_failure_leaves_the_old_file_alone(tmp_path):
    folder = tmp_path / "robot.yaml"
    folder.mkdir()
    with pytest.raises(OutputError, match="nothing was changed"):
        replace_file(str(folder), "new")
    assert os.listdir(tmp_path) == ["robot.yaml"]


def test_what_is_not_a_plain_file_is_never_replaced(tmp_path):
    """As root, a rename would replace even a device such as /dev/null."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(OutputError, match="not a plain file"):
        replace_file(str(path), "new")
    assert stat.S_ISFIFO(path.stat().st_mode) and os.listdir(tmp_path) == ["pipe"]
