"""The force-angle margin against closed forms."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.apps.tip_over import margin, vehicle_file
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import GRAVITY_M_S2

EXACT = 1e-9
WEIGHT_N = 10.0 * GRAVITY_M_S2
SIZES, HEIGHTS = st.floats(0.05, 1.0), st.floats(0.02, 2.0)


def box(half_length_m, half_width_m, height_m, payloads=None):
    contacts = [(x * half_length_m, y * half_width_m) for x in (1, -1) for y in (1, -1)]
    return margin.Vehicle("box", tuple(contacts), margin.Mass(10.0, 0.0, 0.0, height_m), payloads or {})


@given(SIZES, SIZES, HEIGHTS)
@settings(max_examples=50)
def test_at_rest_the_margin_is_the_angle_of_the_half_track(half_length_m, half_width_m, height_m):
    found = margin.Situation(box(half_length_m, half_width_m, height_m)).margin()
    assert found.angle_rad == pytest.approx(math.atan(min(half_length_m, half_width_m) / height_m), abs=EXACT)


@given(SIZES, SIZES, HEIGHTS, st.floats(0, 1))
@settings(max_examples=20)
def test_it_tips_at_g_half_base_by_height(half_length_m, half_width_m, height_m, share):
    """And with a reserve where the margin's tangent says; first along its nearer side."""
    made = margin.Situation(box(half_length_m, half_width_m, height_m))
    reserve = 0.999 * share * math.atan(min(half_length_m, half_width_m) / height_m)
    for reach_m, names in ((half_length_m, ("forward", "back")), (half_width_m, ("left", "right"))):
        for name in names:
            tips = margin.greatest_acceleration(made, margin.DIRECTIONS[name])
            assert tips == pytest.approx(min(1000.0, GRAVITY_M_S2 * reach_m / height_m), rel=1e-9)
            kept = margin.greatest_acceleration(made, margin.DIRECTIONS[name], reserve)
            closed = GRAVITY_M_S2 * math.tan(math.atan(reach_m / height_m) - reserve)
            assert kept <= min(1000.0, closed) * (1 + 1e-9)
            if reach_m <= min(half_length_m, half_width_m):
                assert kept == pytest.approx(min(1000.0, closed), rel=1e-6)
    assert margin.greatest_acceleration(made) == pytest.approx(min(margin.limits(made).values()), rel=1e-9)


def test_payload_and_arm_move_the_centre_of_mass():
    loaded = box(0.3, 0.2, 0.1, {"arm": margin.Mass(10.0, 0.2, 0.0, 0.5)})
    assert loaded.whole == margin.Mass(20.0, pytest.approx(0.1), 0.0, pytest.approx(0.3))
    assert margin.limits(margin.Situation(loaded))["back"] == pytest.approx(GRAVITY_M_S2 * 0.2 / 0.3)
    height_m = (10 * 0.25 + 4 * 0.3) / 14.0
    assert with_arm().vehicle.whole == pytest.approx((14.0, 4.0 * 0.6 / 14.0, 0.0, height_m))


@given(SIZES, SIZES, HEIGHTS)
@settings(max_examples=20)
def test_a_drive_that_brakes_in_a_curve_keeps_the_reserve(half_length_m, half_width_m, height_m):
    """On contacts that lie askew the limits of each direction alone do not; of two limits the drive loses one share."""
    askew = ((half_length_m, 0.0), (0.0, half_width_m), (-half_length_m, 0.0), (0.0, -half_width_m))
    vehicle = box(half_length_m, half_width_m, height_m)._replace(contacts=askew)
    found = margin.drive_limits(margin.Situation(vehicle), (0.0, 0.0))
    assert found.along_m_s2 == pytest.approx(
        min(1000.0, GRAVITY_M_S2 * half_length_m / height_m) / 2, rel=0.05
    )
    whole = math.hypot(*found)
    corner = margin.Situation(vehicle, whole, direction=(found.along_m_s2 / whole, -found.curve_m_s2 / whole))
    assert corner.margin().angle_rad == pytest.approx(0.0, abs=1e-6)


def test_turns_of_a_centre_of_mass_that_is_not_in_the_middle_are_taken_from_the_limits():
    payload = {"arm": margin.Mass(10.0, 0.2, 0.0, 0.1)}
    situation = margin.Situation(box(0.3, 0.2, 0.1, payload))
    still, turning = (margin.drive_limits(situation, turn) for turn in ((0.0, 0.0), (3.0, 2.0)))
    assert still.along_m_s2 - turning.along_m_s2 == pytest.approx(0.1 * (3.0**2 + 2.0))
    with pytest.raises(
        ConfigError, match="expected a lower centre of mass, slower turns or a smaller reserve$"
    ):
        margin.drive_limits(situation, (30.0, 2.0))


# -- a force at a point, against the moments of a box about its lower edge

BOX = (0.3, 0.2, 0.25)
ASLANT_M = math.hypot(0.2, 0.4)


@pytest.mark.parametrize(
    "at, direction, force_n",
    [
        ((0.0, 0.0, 0.4), (0.0, 1.0, 0.0), WEIGHT_N * 0.2 / 0.4),
        ((0.0, 0.0, 0.4), None, WEIGHT_N * 0.2 / ASLANT_M),
        ((0.0, 0.5, 0.3), (0.0, 0.0, -1.0), WEIGHT_N * 0.2 / (0.5 - 0.2)),
        ((0.1, 0.1, 0.3), (0.0, 0.0, -1.0), margin.MOST_N),
    ],
    ids=["level", "worst direction", "load beyond the edge", "load above the contacts"],
)
def test_a_force_tips_a_box_by_its_moment_about_the_lower_edge(at, direction, force_n):
    assert margin.greatest_force(
        margin.Situation(box(*BOX), push=margin.Push(0.0, at, direction))
    ) == pytest.approx(force_n)


def test_a_level_push_and_an_acceleration_add_their_moments():
    """Sideways: weight * b = m * a * height + force * its height."""
    push = margin.Push(20.0, (0.0, 0.0, 0.4), (0.0, -1.0, 0.0))
    expected = (WEIGHT_N * 0.2 - 20.0 * 0.4) / (10.0 * 0.25)
    assert margin.limits(margin.Situation(box(*BOX), push=push))["left"] == pytest.approx(expected)


def test_a_push_at_the_centre_of_mass_tips_as_the_inertia_does():
    made, push = box(*BOX), margin.Push(20.0, (0.0, 0.0, 0.25), (0.0, -1.0, 0.0))
    expected = pytest.approx(
        [each.angle_rad for each in margin.Situation(made, 2.0, direction=(0.0, 1.0)).margins()]
    )
    assert [each.angle_rad for each in margin.Situation(made, push=push).margins()] == expected


def test_a_slope_turns_the_weight():
    """Uphill by s, the margin to the axis behind is smaller by s."""
    made, slope_rad = box(*BOX), math.radians(10)
    behind = margin.Situation(made, 0.0, slope_rad, direction=(1.0, 0.0)).margin().angle_rad
    assert behind == pytest.approx(min(math.atan(0.2 / 0.25), math.atan(0.3 / 0.25) - slope_rad), abs=1e-2)
    assert (
        margin.greatest_acceleration(margin.Situation(made, 0.0, math.atan(0.3 / 0.25) + 0.01), (1.0, 0.0))
        == 0
    )


# -- an arm, and sweeps


ARM = margin.Arm(mass_kg=4.0, x_m=0.1, y_m=0.0, height_m=0.3, length_m=0.8, centre_m=0.5, angle_deg=0.0)


def with_arm(**values):
    return margin.Situation(box(*BOX)._replace(arm=ARM._replace(**values)))


def test_a_sweep_over_the_arms_angle_finds_where_a_load_on_its_tip_tips_the_box():
    """Moments about the front edge: 10 kg * 0.3 m against 4 kg and 60 N beyond it."""
    down = margin.Push(60.0, None, (0.0, 0.0, -1.0))
    over = margin.parse_range("arm-angle=0:80")
    situation = with_arm()._replace(push=down)
    (turning,) = margin.crossings(situation, over, margin.sweep(situation, over))
    c = math.cos(math.radians(turning))
    moment = 10 * 0.3 + 4 * (0.2 - 0.5 * c) + 60 / GRAVITY_M_S2 * (0.2 - 0.8 * c)
    assert moment == pytest.approx(0.0, abs=1e-6)


# -- files


GOOD = {
    "name": "box",
    "contacts": [[1, 1], [1, -1], [-1, 0]],
    "body": {"mass_kg": 1, "x_m": 0, "y_m": 0, "height_m": 0.1},
}


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"contacts": [[0, 0], [1, 1], [2, 2]]}, "span an area"),
        ({"contacts": [[0, 0], [1, 1]]}, "contacts is .* expected a list of three to 100 points"),
        ({"contacts": [[0, 0], [1, math.nan], [2, 0]]}, r"contacts\[1\] is \[1, nan\]"),
        ({"body": {**GOOD["body"], "mass_kg": 0}}, "body.mass_kg is 0, expected a number from"),
        ({"payloads": {"arm": {**GOOD["body"], "hight_m": 1}}}, "key payloads.arm.hight_m is unknown"),
        ({"arm": {"mass_kg": 1}}, "key arm.x_m is missing"),
        (
            {"arm": {**ARM._asdict(), "angle_deg": 200}},
            "arm.angle_deg is 200, expected a number from 0 to 180",
        ),
        ({"arm": {**ARM._asdict(), "centre_m": 0.9}}, "arm.centre_m is 0.9, expected a place on the arm"),
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
