"""`mrl tip-over`: margins, limits, a picture."""

import math

import pytest

from mrl_driver.apps.tip_over import vehicle_file
from mrl_driver.apps.tip_over.margin import QUANTITIES, Situation
from mrl_driver.robot import models
from tests.documents.blocks import ROOT

from .run import fails, mrl


def test_margins_and_limits():
    done = mrl("tip-over", "mecanum-arm")
    assert done.returncode == 0
    assert "26 kg" in done.stdout and "margin at rest on flat ground: 40.3 deg" in done.stdout
    assert "left                    8.31              5.73" in done.stdout


@pytest.mark.parametrize(
    "words, expected",
    [
        (("nope",), "is unknown, expected duo-mast, mecanum-arm"),
        (("mecanum-arm", "--slope", "95"), "'--slope': 95.0, expected at least 0 and below 90"),
        (("mecanum-arm", "--plot", "arm.txt"), "expected a file that ends in .png"),
        (("mecanum-arm", "--force", "5", "--at", "1,2"), "--at is '1,2', expected three numbers"),
        (("mecanum-arm", "--force", "5", "--at", "0,0,-1"), "--at 0,0,-1 is below the ground"),
        (("mecanum-arm", "--force", "5", "--direction", "north"), "--direction is 'north', expected worst"),
        (("mecanum-arm", "--direction", "left"), "without a force, expected --force N"),
        (("traxbot", "--force", "5"), "traxbot has no arm, expected the point of attack"),
        (("mecanum-arm", "--sweep", "colour=0:1"), "expected QUANTITY=FROM:TO with arm-angle"),
        (("mecanum-arm", "--sweep", "force=9:1"), "with two rising numbers from 0 to 100000 N"),
        (("mecanum-arm", "--force", "5", "--sweep", "force=0:9"), "expected one of them"),
        (("mecanum-arm", "--limits", "x.yaml", "--sweep", "force=0:9"), "expected one of them"),
        (("duo-mast", "--limits", "duo"), "belongs to the package, expected a copy"),
        (("duo-mast", "--limits", "pioneer"), "board without motors"),
    ],
)
def test_what_cannot_be_is_one_line(words, expected):
    assert expected in fails(2, "tip-over", *words)


def test_a_force_at_the_tip_of_the_arm():
    """26 kg on a half width of 0.15 m, pushed 0.8 m above the ground."""
    expected = 26 * 9.80665 * 0.15 / (0.15**2 + 0.8**2) ** 0.5
    done = mrl("tip-over", "mecanum-arm", "--force", "30")
    assert "margin with 30 N at 0.12, 0.00, 0.80 m, worst direction" in done.stdout
    assert f"force there: tips over at {expected:.1f} N, 10 deg kept to" in done.stdout


def test_limits_go_into_the_robots_file(tmp_path):
    """Braking is at most the board's own ramp, 500 mm/s in 1 s."""
    path = tmp_path / "tall.yaml"
    path.write_text((ROOT / "mrl_driver" / "robot" / "models" / "duo.yaml").read_text())
    done = mrl("tip-over", "duo-mast", "--limits", path)
    assert (
        done.returncode == 0 and "linear_acceleration_m_s2 0.4, braking_m_s2 0.5, curve_m_s2" in done.stdout
    )
    limits = models.load(str(path)).limits
    assert limits.braking_m_s2 == 0.5 and 0.5 < limits.curve_m_s2 < 1.0
    assert "# mrl tip-over, 10 deg kept" in path.read_text()


def test_a_sweep_is_printed_and_drawn(tmp_path):
    picture = tmp_path / "force.png"
    done = mrl("tip-over", "mecanum-arm", "--sweep", "force=0:60", "--plot", picture)
    assert "margin 0 at 46.99 N" in done.stdout and "60  tips over" in done.stdout
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_without_a_sweep_the_margin_is_drawn_over_the_acceleration(tmp_path):
    picture = tmp_path / "arm.svg"
    done = mrl("tip-over", "mecanum-arm", "--plot", picture)
    assert done.stdout.endswith(f"{picture}\n") and b"acceleration [m/s2]" in picture.read_bytes()


def test_documented_margins_are_those_of_the_packaged_vehicle():
    def shown(name, *values):
        found = Situation(vehicle_file.load("mecanum-arm"))
        at = [QUANTITIES[name].change(found, value).margin().angle_rad for value in values]
        return " / ".join(f"{math.degrees(angle):.1f}" for angle in at)

    text = (ROOT / "docs" / "experiments.md").read_text()
    rows = {"arm-angle": (0, 90, 180), "arm-height": (0.1, 0.8, 1.5), "acceleration": (2, 6), "force": (30,)}
    assert all(f"| {shown(name, *values)} deg" in text for name, values in rows.items())
