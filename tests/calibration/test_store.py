"""Files that a calibration writes."""

import os

import pytest

from mrl_driver.calibration.store import replace_file
from mrl_driver.errors import ConfigError


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.yaml").write_text("old")
    (tmp_path / "link.yaml").symlink_to("real.yaml")
    replace_file(str(tmp_path / "link.yaml"), "new")
    assert (tmp_path / "link.yaml").is_symlink() and (tmp_path / "real.yaml").read_text() == "new"


def test_permissions_stay(tmp_path):
    path = tmp_path / "robot.yaml"
    path.write_text("old")
    path.chmod(0o640)
    replace_file(str(path), "new")
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_failure_leaves_the_old_file_alone(tmp_path):
    folder = tmp_path / "robot.yaml"
    folder.mkdir()
    with pytest.raises(ConfigError, match="nothing was changed"):
        replace_file(str(folder), "new")
    assert os.listdir(tmp_path) == ["robot.yaml"]
