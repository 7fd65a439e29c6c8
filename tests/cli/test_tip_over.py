"""`mrl tip-over`: margins, limits, a picture."""

import json

import pytest

from .run import fails, mrl


def test_margins_and_limits():
    done = mrl("tip-over", "mecanum-arm")
    assert done.returncode == 0
    assert "26 kg" in done.stdout and "margin at rest on flat ground: 40.3 deg" in done.stdout
    assert "left                    8.31              5.73" in done.stdout


def test_json_and_a_picture(tmp_path):
    picture = tmp_path / "arm.png"
    done = mrl("tip-over", "mecanum-arm", "--reserve", "15", "--slope", "5", "--plot", picture, "--json")
    told = json.loads(done.stdout)
    assert told["limit_m_s2"]["left"] < told["tips_m_s2"]["left"] < 8.31
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    "words, expected",
    [
        (("nope",), "is unknown, expected mecanum-arm"),
        (("mecanum-arm", "--slope", "95"), "'--slope': 95.0 is not in the range 0<=x<90"),
        (("mecanum-arm", "--reserve", "nan"), "'--reserve': nan is not in the range"),
        (("mecanum-arm", "--plot", "arm.txt"), "expected a file that ends in .png"),
    ],
)
def test_what_cannot_be_is_one_line(words, expected):
    assert expected in fails(2, "tip-over", *words)


def test_a_vehicle_that_tips_over_at_rest_is_said_to(tmp_path):
    file = tmp_path / "odd.yaml"
    contacts, body = "[[0.2, 0.2], [0.2, -0.2], [-0.2, 0]]", "{mass_kg: 10, x_m: 1, y_m: 0, height_m: 0.2}"
    file.write_text(f"name: odd\ncontacts: {contacts}\nbody: {body}\n")
    assert "deg; it tips over at rest: its centre of mass" in mrl("tip-over", file).stdout
