"""The force-angle margin against closed forms."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import GRAVITY_M_S2
from mrl_driver.robot import models
from mrl_driver.tip_over import sweep, vehicle_file
from mrl_driver.tip_over.margin import (
    DIRECTIONS,
    MOST_N,
    Arm,
    Mass,
    Push,
    Vehicle,
    greatest_acceleration,
    greatest_acceleration_anywhere,
    greatest_force,
    least,
    limits,
    margins,
    worst,
)

EXACT = 1e-9
WEIGHT_N = 10.0 * GRAVITY_M_S2
SIZES, HEIGHTS = st.floats(0.05, 1.0), st.floats(0.02, 2.0)


def box(half_length_m, half_width_m, height_m, payloads=None):
    contacts = [(x * half_length_m, y * half_width_m) for x in (1, -1) for y in (1, -1)]
    return Vehicle("box", tuple(contacts), Mass(10.0, 0.0, 0.0, height_m), payloads or {})


@given(SIZES, SIZES, HEIGHTS)
@settings(max_examples=50)
def test_at_rest_the_margin_is_the_angle_of_the_half_track(half_length_m, half_width_m, height_m):
    """Its measure is the angle times the moment about the axis; a moment like that of the weight takes it away."""
    made, reach_m = box(half_length_m, half_width_m, height_m), min(half_length_m, half_width_m)
    found, angle_rad = least(margins(made)), math.atan(min(half_length_m, half_width_m) / height_m)
    assert found.angle_rad == pytest.approx(angle_rad, abs=EXACT)
    assert found.measure_n_m == pytest.approx(angle_rad * WEIGHT_N * reach_m)
    tipping = margins(made, moment_n_m=(WEIGHT_N * half_width_m, 0.0, 0.0))
    assert least(tipping).angle_rad == pytest.approx(0.0, abs=1e-7)


@given(SIZES, SIZES, HEIGHTS, st.floats(0, 1))
@settings(max_examples=20)
def test_it_tips_at_g_half_base_by_height(half_length_m, half_width_m, height_m, share):
    """And with a reserve where the margin's tangent says; first along its nearer side."""
    made = box(half_length_m, half_width_m, height_m)
    reserve = 0.999 * share * math.atan(min(half_length_m, half_width_m) / height_m)
    for reach_m, names in ((half_length_m, ("forward", "back")), (half_width_m, ("left", "right"))):
        for name in names:
            tips = greatest_acceleration(made, DIRECTIONS[name])
            assert tips == pytest.approx(min(1000.0, GRAVITY_M_S2 * reach_m / height_m), rel=1e-9)
            kept = greatest_acceleration(made, DIRECTIONS[name], reserve)
            closed = GRAVITY_M_S2 * math.tan(math.atan(reach_m / height_m) - reserve)
            assert kept <= min(1000.0, closed) * (1 + 1e-9)
            if reach_m <= min(half_length_m, half_width_m):
                assert kept == pytest.approx(min(1000.0, closed), rel=1e-6)
    assert greatest_acceleration_anywhere(made) == pytest.approx(min(limits(made).values()), rel=1e-9)


def test_vehicle_whose_axes_lie_askew_tips_over_first_between_the_named_directions():
    """Its four contacts are in front, behind and at the sides, so the nearest axes are 45 deg from its own."""
    diamond = Vehicle("diamond", ((0.2, 0), (0, 0.2), (-0.2, 0), (0, -0.2)), Mass(10.0, 0, 0, 0.3), {})
    anywhere = GRAVITY_M_S2 * 0.2 / 0.3 * math.sqrt(0.5)
    assert greatest_acceleration_anywhere(diamond) == pytest.approx(anywhere, rel=1e-9)
    assert min(limits(diamond).values()) == pytest.approx(anywhere * math.sqrt(2), rel=1e-9)


def test_a_slope_turns_the_weight():
    """Uphill by s, the margin to the axis behind is smaller by s."""
    made, slope_rad = box(0.3, 0.2, 0.25), math.radians(10)
    behind = least(margins(made, slope=(-math.sin(slope_rad), 0.0))).angle_rad
    across = math.atan(0.2 / 0.25)
    assert behind == pytest.approx(min(across, math.atan(0.3 / 0.25) - slope_rad), abs=1e-2)
    assert greatest_acceleration(made, (1.0, 0.0), 0.0, math.atan(0.3 / 0.25) + 0.01) == 0


def test_a_push_at_the_centre_tips_as_the_inertia_does():
    made = box(0.3, 0.2, 0.25)
    by_push, by_inertia = margins(made, force_n=(0.0, 30.0, 0.0)), margins(made, (0.0, -3.0))
    assert [a.angle_rad for a in by_push] == pytest.approx([b.angle_rad for b in by_inertia])


def test_payload_and_arm_move_the_centre_of_mass():
    loaded = box(0.3, 0.2, 0.1, {"arm": Mass(10.0, 0.2, 0.0, 0.5)})
    assert loaded.whole == Mass(20.0, pytest.approx(0.1), 0.0, pytest.approx(0.3))
    assert limits(loaded)["back"] == pytest.approx(GRAVITY_M_S2 * 0.2 / 0.3)
    height_m = (10 * 0.25 + 4 * 0.3) / 14.0
    assert with_arm().vehicle.whole == pytest.approx((14.0, 4.0 * 0.6 / 14.0, 0.0, height_m))


# -- a force at a point, against the moments of a box about its lower edge

BOX = (0.3, 0.2, 0.25)
ASLANT_M = math.hypot(0.2, 0.4)
FORCES = st.floats(0.0, 0.9)
ANGLES = st.floats(0.0, math.tau)


@pytest.mark.parametrize(
    "at, direction, force_n",
    [
        ((0.0, 0.0, 0.4), (0.0, 1.0, 0.0), WEIGHT_N * 0.2 / 0.4),
        ((0.0, 0.0, 0.4), None, WEIGHT_N * 0.2 / ASLANT_M),
        ((0.0, 0.5, 0.3), (0.0, 0.0, -1.0), WEIGHT_N * 0.2 / (0.5 - 0.2)),
        ((0.1, 0.1, 0.3), (0.0, 0.0, -1.0), MOST_N),
    ],
    ids=["level", "worst direction", "load beyond the edge", "load above the contacts"],
)
def test_a_force_tips_a_box_by_its_moment_about_the_lower_edge(at, direction, force_n):
    assert greatest_force(box(*BOX), Push(0.0, at, direction)) == pytest.approx(force_n)


def test_the_worst_direction_of_a_push_is_at_right_angles_to_its_arm():
    found = worst(box(*BOX), push=Push(WEIGHT_N * 0.2 / ASLANT_M, (0.0, 0.0, 0.4))).push
    assert (abs(found[1]), found[2]) == pytest.approx((0.4 / ASLANT_M, 0.2 / ASLANT_M), abs=1e-6)


def test_a_level_push_and_an_acceleration_add_their_moments():
    """Sideways: weight * b = m * a * height + force * its height."""
    push = Push(20.0, (0.0, 0.0, 0.4), (0.0, -1.0, 0.0))
    expected = (WEIGHT_N * 0.2 - 20.0 * 0.4) / (10.0 * 0.25)
    assert limits(box(*BOX), push=push)["left"] == pytest.approx(expected)


def test_a_push_at_the_centre_of_mass_is_a_force_without_a_moment():
    made, force_n = box(*BOX), (3.0, -20.0, 5.0)
    size = math.sqrt(sum(each * each for each in force_n))
    push = Push(size, (0.0, 0.0, 0.25), tuple(each / size for each in force_n))
    assert [each.angle_rad for each in margins(made, push=push)] == pytest.approx(
        [each.angle_rad for each in margins(made, force_n=force_n)]
    )


@given(FORCES, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.05, 1.0), ANGLES, st.floats(-1.0, 1.0))
@settings(max_examples=30)
def test_no_direction_leaves_less_margin_than_the_worst(share, x_m, y_m, height_m, heading, up):
    """Up to the force that tips the vehicle over."""
    made, at = box(*BOX), (x_m, y_m, height_m)
    force_n = share * greatest_force(made, Push(0.0, at))
    level = math.sqrt(1 - up * up)
    direction = (level * math.cos(heading), level * math.sin(heading), up)
    given_direction = least(margins(made, push=Push(force_n, at, direction))).angle_rad
    assert worst(made, push=Push(force_n, at)).angle_rad <= given_direction + EXACT


@given(st.floats(0.0, 3.0), st.floats(0.0, 0.3), ANGLES)
@settings(max_examples=30)
def test_no_direction_of_acceleration_and_slope_is_worse_than_the_worst(acceleration, slope_rad, heading):
    made, out = box(*BOX), (math.cos(heading), math.sin(heading))
    slope = (out[0] * math.sin(slope_rad), out[1] * math.sin(slope_rad))
    found = least(margins(made, (-out[0] * acceleration, -out[1] * acceleration), slope=slope))
    assert worst(made, acceleration, slope_rad).angle_rad <= found.angle_rad + EXACT


# -- an arm, and sweeps


ARM = Arm(mass_kg=4.0, x_m=0.1, y_m=0.0, height_m=0.3, length_m=0.8, centre_m=0.5, angle_deg=0.0)


def with_arm(**values):
    return sweep.Situation(box(*BOX)._replace(arm=ARM._replace(**values)))


@pytest.mark.parametrize(
    "angle_deg, heading_deg, tip",
    [(90, 0, (0.1, 0.0, 1.1)), (180, 0, (-0.7, 0.0, 0.3)), (0, 90, (0.1, 0.8, 0.3))],
)
def test_an_arm_turns_about_its_lower_end(angle_deg, heading_deg, tip):
    made = with_arm(angle_deg=angle_deg, heading_deg=heading_deg)
    assert made.vehicle.tip == pytest.approx(tip)


def test_a_sweep_over_the_arms_angle_finds_where_a_load_on_its_tip_tips_the_box():
    """Moments about the front edge: 10 kg * 0.3 m against 4 kg and 60 N beyond it."""
    down = Push(60.0, None, (0.0, 0.0, -1.0))
    over = sweep.parse("arm-angle=0:80")
    situation = with_arm()._replace(push=down)
    (turning,) = sweep.crossings(situation, over, sweep.sweep(situation, over))
    c = math.cos(math.radians(turning))
    moment = 10 * 0.3 + 4 * (0.2 - 0.5 * c) + 60 / GRAVITY_M_S2 * (0.2 - 0.8 * c)
    assert moment == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    "text, push, expected",
    [
        ("acceleration=0:10", {}, GRAVITY_M_S2 * 0.2 / 0.25),
        ("force=0:90", {"push": Push(0.0, (0.0, 0.0, 0.4))}, WEIGHT_N * 0.2 / ASLANT_M),
    ],
)
def test_a_sweep_crosses_zero_where_the_box_tips(text, push, expected):
    situation, over = sweep.Situation(box(*BOX), **push), sweep.parse(text)
    assert sweep.crossings(situation, over, sweep.sweep(situation, over)) == pytest.approx([expected])


# -- files


def test_the_worked_example():
    """20 kg at 0.08 m and an arm of 6 kg at 0.5 m: sideways it tips at g * 0.15 / 0.177."""
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
        ({"contacts": [[0, 0], [1, 1]]}, "contacts is .* expected a list of three to 100 points"),
        (
            {"contacts": [[0, 0], [1, 1], [0, 1]] * 34},
            "contacts is .* expected a list of three to 100 points",
        ),
        ({"contacts": [[0, 0], [1, "a"], [2, 0]]}, r"contacts\[1\] is 'a', expected a number"),
        ({"contacts": [[0, 0], [1, math.nan], [2, 0]]}, r"contacts\[1\] is nan"),
        ({"body": {**GOOD["body"], "mass_kg": 0}}, "body.mass_kg is 0, expected a number from"),
        ({"body": {"mass_kg": 1}}, "key body.x_m is missing"),
        ({"payloads": {"arm": {**GOOD["body"], "hight_m": 1}}}, "key payloads.arm.hight_m is unknown"),
        ({"payloads": 3}, "payloads is 3"),
        ({"wheels": 4}, "key wheels is unknown"),
        ({"arm": {"mass_kg": 1}}, "key arm.x_m is missing"),
        (
            {"arm": {**ARM._asdict(), "angle_deg": 200}},
            "arm.angle_deg is 200, expected a number from 0 to 180",
        ),
        ({"arm": {**ARM._asdict(), "centre_m": 0.9}}, "arm.centre_m is 0.9, expected a place on the arm"),
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
