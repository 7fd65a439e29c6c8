"""Two robots at a crossing that talk by emulated radio alone, in simulated time."""

import pytest

from sim_arduino.experiments import crossing
from sim_arduino.experiments.experiment_robot import Setting

SETTING = Setting("/nowhere", seed=1000)


@pytest.fixture(scope="module")
def by_radio():
    return crossing.claimed(SETTING)


@pytest.fixture(scope="module")
def cut():
    return crossing.claimed(SETTING, cut=True)


@pytest.fixture(scope="module")
def control():
    return crossing.granted_at_once(SETTING)


def test_second_robot_waits_until_the_first_has_left(by_radio):
    assert (by_radio.team.collisions, by_radio.crossed) == (0, 2) and by_radio.waited_s > 5.0


def test_robots_collide_if_every_claim_is_granted_at_once(control):
    assert control.team.collisions and control.crossed == 0


def test_nobody_gets_the_crossing_while_the_radio_is_cut_and_the_silent_robot_is_named(cut):
    assert cut.crossed == 2, "after the radio is back"
    assert (cut.entered_cut, cut.unnamed, cut.team.collisions) == (0, 0, 0) and 0 < cut.named_s < 6.0


def test_rows_have_a_control(by_radio, cut, control, tmp_path):
    def over_seeds(run, _):
        return [{crossing.claimed: by_radio, crossing.granted_at_once: control}.get(run, cut)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crossing, "over_seeds", over_seeds)
        result = crossing.run(Setting(str(tmp_path)))
    shown = {row.key: row for row in result.rows}
    assert (shown["collided"].ours, shown["collided"].control) == ("0 of 1", "1 of 1")
    assert shown["cut_entered"].ours == 0 and (tmp_path / result.pictures[0]).exists()
