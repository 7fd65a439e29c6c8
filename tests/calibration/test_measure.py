"""Where a run ended: as people type it, and as the emulator writes it down."""

import math

import pytest

from mrl_driver.calibration.ground_truth import Truth, parse_pose, truth_file
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose

ROW = '{"t": 1.0, "x": %s, "y": 0.5, "yaw": 1.5}\n'


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        ("0.012 -0.034 1.5", (0.012, -0.034, math.radians(1.5))),
        ("1,2", (1.0, 2.0, None)),
        (" 1, 2, 350", (1.0, 2.0, math.radians(-10))),
    ],
)
def test_what_people_type(text, pose):
    found = parse_pose(text)
    assert found[:2] == pose[:2]
    assert math.isnan(found.yaw_rad) if pose[2] is None else found.yaw_rad == pytest.approx(pose[2])


@pytest.mark.parametrize("text", ["", "1", "1 2 3 4", "one two", "nan 0", "inf 0", "201 3"])
def test_what_is_not_a_place(text):
    words = "expected x and y in metres, not centimetres" if text == "201 3" else "expected x y"
    with pytest.raises(ConfigError, match=words):
        parse_pose(text)


def test_the_newest_whole_pose_counts(tmp_path):
    """The emulator may be in the middle of a line."""
    file = tmp_path / "truth.jsonl"
    file.write_text("".join(ROW % x for x in range(200)) + '{"t": 2.0, "x": 7')
    assert truth_file(str(file))() == Pose(199.0, 0.5, 1.5)


def test_a_truth_is_measured_from_where_the_run_began(tmp_path):
    file = tmp_path / "truth.jsonl"
    file.write_text(ROW % 1.0)
    ruler = Truth(truth_file(str(file)))
    ruler.begin("run 1")
    file.write_text(ROW % 1.5)
    x_m, y_m, yaw_rad = ruler.end("run 1", lambda pose: None)
    assert (x_m, y_m, yaw_rad) == pytest.approx((0.5 * math.cos(1.5), -0.5 * math.sin(1.5), 0.0))


@pytest.mark.parametrize(
    "text", [None, "", "\n", "x\n", "[1, 2]\n", '{"x": 1}\n', '{"x": null, "y": 0, "yaw": 0}\n']
)
def test_a_file_without_a_pose_is_refused(tmp_path, text):
    file, words = tmp_path / "truth.jsonl", "expected a pose as JSON"
    if text is None:
        words = "does not exist, expected the file that mrl-sim --truth writes"
    else:
        file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        truth_file(str(file))()
