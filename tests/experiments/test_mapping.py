"""The mapping experiment: recorded key presses, and the maps of a drive that is cut short."""

import re

from sim_arduino.experiments import mapping
from sim_arduino.experiments.experiment_robot import Setting

SPIN = "time_s,key\n" + "".join(f"{2.0 + 0.5 * number:.1f},left\n" for number in range(14))
"""The robot stands for 2 s, and then turns on the spot for some 7 s."""
LOST_DEG, KNOWN_DEG, CALIBRATED_DEG = 20.0, 11.0, 1.0
"""About a tenth of a good half turn; a limit of 3 % of a turn; the goal of a calibrated gyro."""


def written(folder, text):
    path = folder / "keys.csv"
    path.write_text(text)
    return str(path)


def test_a_gyro_knows_the_heading_that_the_wheels_lose_and_improves_the_map(tmp_path, monkeypatch):
    """In drives in which the robot turns on the spot.  The control of a gyro is the wheels alone."""
    monkeypatch.setattr(mapping, "KEYS", written(tmp_path, SPIN))
    figures = {row.key: row for row in mapping.run(Setting(str(tmp_path), seeds=1)).rows}
    assert all((tmp_path / name).exists() for name in ("mapping.png", "mapping-laser-wheels-alone.yaml"))
    assert figures["heading_wheels_deg"].ours > LOST_DEG and figures["heading_wheels_deg"].put_in
    assert figures["heading_gyro_deg"].ours < KNOWN_DEG
    assert figures["heading_calibrated_deg"].ours < CALIBRATED_DEG
    wheels = figures["laser_wheels_false_percent"].ours
    for poses in ("gyro", "calibrated", "true"):
        assert figures[f"laser_{poses}_false_percent"].ours < 0.5 * wheels
    for figure in ("heading_gyro_deg", "sonars_gyro_found_percent", "laser_calibrated_false_percent"):
        assert figures[figure].control == figures[re.sub("gyro|calibrated", "wheels", figure)].ours
