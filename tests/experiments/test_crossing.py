"""Two robots at a crossing that talk by emulated radio alone, in simulated time."""

from sim_arduino.experiments import crossing
from sim_arduino.experiments.experiment_robot import Setting

SETTING = Setting("/nowhere", seed=1000)


def test_second_robot_waits_until_the_first_has_left(tmp_path, monkeypatch):
    """Nobody gets the crossing while the radio is cut, and a silent robot is named.  Granted at once, robots collide."""
    by_radio, cut = (crossing.claimed(SETTING, cut=cut) for cut in (False, True))
    control = crossing.granted_at_once(SETTING)
    assert (by_radio.team.collisions, by_radio.crossed) == (0, 2) and by_radio.waited_s > 5.0
    assert control.team.collisions and control.crossed == 0
    assert cut.crossed == 2, "after the radio is back"
    assert (cut.entered_cut, cut.unnamed, cut.team.collisions) == (0, 0, 0) and 0 < cut.named_s < 6.0

    def over_seeds(run, _):
        return [{crossing.claimed: by_radio, crossing.granted_at_once: control}.get(run, cut)]

    monkeypatch.setattr(crossing, "over_seeds", over_seeds)
    result = crossing.run(Setting(str(tmp_path)))
    shown = {row.key: row for row in result.rows}
    assert (shown["collided"].ours, shown["collided"].control) == ("0 of 1", "1 of 1")
    assert shown["cut_entered"].ours == 0 and (tmp_path / result.pictures[0]).exists()
