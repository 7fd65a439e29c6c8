"""The force-angle margin against closed forms."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from mrl_driver.tip_over import vehicle_file
from mrl_driver.tip_over.margin import (
    DIRECTIONS,
    GRAVITY_M_S2,
    Mass,
    Vehicle,
    greatest_acceleration,
    hull,
    least,
    limits,
    margins,
)

EXACT = 1e-9
SIZES, HEIGHTS = st.floats(0.05, 1.0), st.floats(0.02, 2.0)


def box(half_length_m, half_width_m, height_m, payloads=None):
    contacts = [(x * half_length_m, y * half_width_m) for x in (1, -1) for y in (1, -1)]
    return Vehicle("box", tuple(contacts), Mass(10.0, 0.0, 0.0, height_m), payloads or {})


@given(SIZES, SIZES, HEIGHTS)
@settings(max_examples=50)
def test_at_rest_the_margin_is_the_angle_of_the_half_track(half_length_m, half_width_m, height_m):
    found = least(margins(box(half_length_m, half_width_m, height_m))).angle_rad
    assert found == pytest.approx(math.atan(min(half_length_m, half_width_m) / height_m), abs=EXACT)


@given(SIZES, SIZES, HEIGHTS, st.floats(0, 1))
@settings(max_examples=20)
def test_it_tips_at_g_half_base_by_height(half_length_m, half_width_m, height_m, share):
    """And with a reserve where the margin's tangent says."""
    made = box(half_length_m, half_width_m, height_m)
    for reach_m, names in ((half_length_m, ("forward", "back")), (half_width_m, ("left", "right"))):
        reserve = share * math.atan(min(half_length_m, half_width_m) / height_m)
        for name in names:
            tips = greatest_acceleration(made, DIRECTIONS[name])
            assert tips == pytest.approx(min(1000.0, GRAVITY_M_S2 * reach_m / height_m), rel=1e-9)
            kept = greatest_acceleration(made, DIRECTIONS[name], reserve * 0.999)
            closed = GRAVITY_M_S2 * math.tan(math.atan(reach_m / height_m) - reserve * 0.999)
            assert kept <= min(1000.0, closed) * (1 + 1e-9)


def test_a_reserve_along_the_nearer_edge_has_a_closed_form():
    made, reserve = box(0.3, 0.2, 0.25), math.radians(12)
    expected = GRAVITY_M_S2 * math.tan(math.atan(0.2 / 0.25) - reserve)
    assert limits(made, reserve)["left"] == pytest.approx(expected, rel=1e-9)


def test_a_slope_turns_the_weight():
    """Uphill by s, the margin to the axis behind is smaller by s."""
    made, slope_rad = box(0.3, 0.2, 0.25), math.radians(10)
    behind = least(margins(made, slope=(-math.sin(slope_rad), 0.0))).angle_rad
    across = math.atan(0.2 / 0.25)
    assert behind == pytest.approx(min(across, math.atan(0.3 / 0.25) - slope_rad), abs=1e-2)
    assert greatest_acceleration(made, (1.0, 0.0), 0.0, math.atan(0.3 / 0.25) + 0.01) == 0


def test_the_measure_is_angle_times_the_moment_about_the_axis():
    made = box(0.3, 0.2, 0.25)
    weight_n = 10.0 * GRAVITY_M_S2
    assert least(margins(made)).measure_n_m == pytest.approx(math.atan(0.2 / 0.25) * weight_n * 0.2)


def test_a_push_at_the_centre_tips_as_the_inertia_does():
    made = box(0.3, 0.2, 0.25)
    by_push, by_inertia = margins(made, force_n=(0.0, 30.0, 0.0)), margins(made, (0.0, -3.0))
    assert [a.angle_rad for a in by_push] == pytest.approx([b.angle_rad for b in by_inertia])


def test_a_moment_moves_the_weight_by_moment_over_weight():
    made = box(0.3, 0.2, 0.25)
    weight_n = 10.0 * GRAVITY_M_S2
    tipping = margins(made, moment_n_m=(weight_n * 0.2, 0.0, 0.0))
    assert least(tipping).angle_rad == pytest.approx(0.0, abs=EXACT)


def test_a_payload_raises_the_centre_of_mass():
    loaded = box(0.3, 0.2, 0.1, {"arm": Mass(10.0, 0.2, 0.0, 0.5)})
    assert loaded.whole == Mass(20.0, pytest.approx(0.1), 0.0, pytest.approx(0.3))
    assert limits(loaded)["back"] == pytest.approx(GRAVITY_M_S2 * 0.2 / 0.3)


def test_more_acceleration_never_leaves_more_margin_behind():
    made = vehicle_file.load("mecanum-arm")
    angles = [least(margins(made, (value / 10, 0.0))).angle_rad for value in range(80, 200)]
    assert angles == sorted(angles, reverse=True) and angles[-1] < 0


def test_points_inside_are_no_corners():
    assert hull([(0, 0), (1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0)]) == [(-1, -1), (1, -1), (1, 1), (-1, 1)]


# -- files


def test_the_worked_example():
    """20 kg at 0.08 m and 6 kg at 0.5 m: sideways it tips at g * 0.15 / 0.177."""
    made = vehicle_file.load("mecanum-arm")
    height_m = (20 * 0.08 + 6 * 0.5) / 26
    assert limits(made)["left"] == pytest.approx(GRAVITY_M_S2 * 0.15 / height_m)


@pytest.mark.parametrize("name", ["traxbot", "omni"])
def test_a_robot_model_is_a_vehicle(name):
    model = models.load(name)
    assert vehicle_file.load(name).whole.mass_kg == model.body.mass_kg


GOOD = {
    "name": "box",
    "contacts": [[1, 1], [1, -1], [-1, 0]],
    "body": {"mass_kg": 1, "x_m": 0, "y_m": 0, "height_m": 0.1},
}


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"contacts": [[0, 0], [1, 1], [2, 2]]}, "span an area"),
        ({"contacts": [[0, 0], [1, 1]]}, "contacts is .* expected a list of three"),
        ({"contacts": [[0, 0], [1, "a"], [2, 0]]}, r"contacts\[1\] is 'a', expected a number"),
        ({"contacts": [[0, 0], [1, math.nan], [2, 0]]}, r"contacts\[1\] is nan"),
        ({"body": {**GOOD["body"], "mass_kg": 0}}, "body.mass_kg is 0, expected a number from"),
        ({"body": {"mass_kg": 1}}, "key body.x_m is missing"),
        ({"payloads": {"arm": {**GOOD["body"], "hight_m": 1}}}, "key payloads.arm.hight_m is unknown"),
        ({"payloads": 3}, "payloads is 3"),
        ({"wheels": 4}, "key wheels is unknown"),
        ({"name": ""}, "name is ''"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(wrong, words):
    with pytest.raises(ConfigError, match=words) as caught:
        vehicle_file.parse({**GOOD, **wrong}, "box.yaml")
    assert "\n" not in str(caught.value) and str(caught.value).startswith("box.yaml")


@pytest.mark.parametrize(
    "name, words", [("stingbot", "two wheels"), ("nope", "mecanum-arm"), ("no.yaml", "No such")]
)
def test_what_is_no_vehicle_is_refused(name, words):
    with pytest.raises(ConfigError, match=words):
        vehicle_file.load(name)
