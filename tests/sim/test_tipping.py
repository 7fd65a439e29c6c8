"""The zero moment point of the emulated body against closed forms of a box."""

import math

import pytest

from mrl_driver.geometry import GRAVITY_M_S2
from sim_arduino.hardware.tipping import PART_S, PARTS, Tipping

BOX = ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))
HEIGHT_M = 0.5
TIPS_M_S2 = GRAVITY_M_S2 * 0.2 / HEIGHT_M


def after(steps, contacts=BOX, centre=(0.0, 0.0, HEIGHT_M)):
    """A body that has moved in steps of 1 ms: forward, aside [m/s] and turn [rad/s]."""
    body = Tipping(contacts, centre)
    for speeds in steps:
        body.moved(0.001, *(0.001 * speed for speed in speeds))
    return body


@pytest.mark.parametrize("share, tips", [(0.98, False), (1.02, True), (-0.98, False), (-1.02, True)])
def test_a_box_tips_at_g_half_base_by_height(share, tips):
    body = after((share * TIPS_M_S2 * 0.001 * step, 0.0, 0.0) for step in range(300))
    assert body.point == pytest.approx((-share * 0.2, 0.0), abs=1e-3)
    assert (body.tips_s > 0) == tips


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_curve_tips_it_by_speed_times_turn(share):
    turn = share * GRAVITY_M_S2 * 0.1 / HEIGHT_M / 2.0
    body = after([(2.0, 0.0, turn)] * 300)
    assert body.point == pytest.approx((0.0, -share * 0.1), abs=1e-3) and (body.tips_s > 0) == (share > 1)


def test_a_turn_in_place_pulls_a_centre_of_mass_that_is_not_in_the_middle():
    body = after([(0.0, 0.0, 2.0)] * 300, centre=(0.1, 0.0, HEIGHT_M))
    assert body.point == pytest.approx((0.1 + HEIGHT_M * 2.0**2 * 0.1 / GRAVITY_M_S2, 0.0), abs=1e-3)


def test_a_jerk_counts_as_the_change_of_the_mean_speed():
    body = after([(0.0, 0.0, 0.0)] * 200 + [(0.1, 0.0, 0.0)] * 200)
    assert body.most_m_s2 == pytest.approx(0.1 / (PARTS * PART_S), rel=0.05)


def test_a_body_that_stands_aside_of_its_contacts_tips_and_one_on_a_triangle_does_not():
    assert after([(0.0, 0.0, 0.0)] * 300, centre=(0.3, 0.0, 0.1)).tips_s > 0
    triangle = tuple((math.cos(angle), math.sin(angle)) for angle in (0.0, 2.1, 4.2))
    assert after([(0.0, 0.0, 0.0)] * 300, triangle).tips_s == 0
