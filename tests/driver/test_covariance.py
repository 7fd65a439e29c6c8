"""Constant errors and the bias of a gyro in the covariance of the pose, against their closed forms."""

from types import SimpleNamespace

import pytest

from mrl_driver.geometry import ORIGIN, advance
from mrl_driver.robot.covariance import OmniUncertainty, Uncertainty
from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import ImuMount, Noise, load

NOTHING = (0.0,) * 6
STEPS, STEP_M, STEP_S = 200, 0.005, 0.02
BIAS_VARIANCE = 1e-6
XX, YY, YT, TT = 0, 3, 4, 5


def sure(**noise):
    """The covariance of a robot with these errors alone."""
    model = load("traxbot")._replace(noise=Noise(0.0, 0.0, **noise), imu=ImuMount(gyro_scale_sd=0.0))
    return Uncertainty(model, NOTHING)


def drive(made, pose=ORIGIN, steps=STEPS, step_m=STEP_M, turn_rad=0.0, gyro=None):
    """The pose after equal steps."""
    half_m = turn_rad * load("traxbot").drive.wheel_separation_m / 2
    for _ in range(steps):
        after = advance(pose, step_m, turn_rad)
        made.update(pose, after, (step_m + half_m, step_m - half_m), turn_rad, STEP_S, gyro)
        pose = after
    return pose


def gyro():
    """A gyro with nothing but an unknown bias."""
    return SimpleNamespace(kept=1.0, bias_variance=BIAS_VARIANCE, noise_rad2_s=0.0, unseen_rad2=0.0)


@pytest.mark.parametrize(
    "noise, way, at, variance",
    [
        ({"distance_scale_sd": 0.01}, {}, XX, 0.01**2),
        ({"turn_scale_sd": 0.1}, {"step_m": 0.0, "turn_rad": 0.01}, TT, (0.1 * 2.0) ** 2),
    ],
    ids=["distance", "turns"],
)
def test_a_scale_grows_with_the_way_and_cancels_on_the_way_back(noise, way, at, variance):
    made, way = sure(**noise), {"step_m": STEP_M, **way}
    pose = drive(made, **way)
    assert made.spread[at] == pytest.approx(variance)
    drive(made, pose, **{name: -each for name, each in way.items()})
    assert made.spread == pytest.approx(NOTHING, abs=1e-12)


def test_unequal_wheels_bend_a_straight_way():
    made = sure(wheel_ratio_sd=0.01)
    drive(made)
    bend = 0.01 / load("traxbot").drive.wheel_separation_m
    assert made.spread[TT] == pytest.approx(bend**2)
    assert made.spread[YY] == pytest.approx((bend / 2) ** 2)
    assert made.spread[YT] == pytest.approx(bend**2 / 2)


def test_bias_turns_the_yaw_with_the_time_and_moves_the_end_with_its_square():
    """The yaw is off by what the bias has made of it, over the whole way that the wheels alone continue."""
    seconds, made, before = STEPS * STEP_S, sure(), sure(turn_scale_sd=0.1, wheel_ratio_sd=0.01)
    drive(made, gyro=gyro())
    assert made.spread[TT] == pytest.approx(BIAS_VARIANCE * seconds**2)
    assert made.spread[YY] == pytest.approx(BIAS_VARIANCE * (seconds / 2) ** 2, rel=1e-3)  # over a way of 1 m
    assert made.spread[YT] == pytest.approx(BIAS_VARIANCE * seconds**2 / 2, rel=1e-3)
    made = sure()
    drive(made, drive(made, step_m=0.0, gyro=gyro()))
    assert made.spread[YY] == pytest.approx(BIAS_VARIANCE * seconds**2, rel=1e-3)
    drive(before, turn_rad=0.01, gyro=SimpleNamespace(**{**vars(gyro()), "bias_variance": 0.0}))
    assert before.spread == pytest.approx(NOTHING, abs=1e-15), (
        "the errors of the wheels' turn are not the gyro's"
    )


def test_bias_that_was_measured_anew_errs_independently_of_before():
    made, seconds = sure(), STEPS * STEP_S
    chip = gyro()
    pose = drive(made, gyro=chip)
    chip.kept = 0.0
    drive(made, pose, gyro=chip)
    assert made.spread[TT] == pytest.approx(2 * BIAS_VARIANCE * seconds**2)


def test_scales_of_omni_wheels_err_as_the_way_of_larger_wheels():
    """Each scale's effect is the change of the pose at the end of an arc of 100 steps, per change of the wheel."""
    sd, small, wheels_m = 0.01, 1e-6, (0.002, 0.006, -0.004)
    omni = load("omni")
    kinematics = kinematics_of(omni.base)

    def arc(made=None, scales=(1.0, 1.0, 1.0)):
        pose = ORIGIN
        for _ in range(100):
            scaled_m = [wheel_m * scale for wheel_m, scale in zip(wheels_m, scales)]
            step = kinematics.step(scaled_m)
            after = advance(pose, step.forward, step.turn, step.left)
            if made is not None:
                made.update(pose, after, scaled_m, step.turn, STEP_S)
            pose = after
        return pose

    made = OmniUncertainty(omni._replace(noise=Noise(0.0, 0.0, wheel_ratio_sd=sd)), NOTHING)
    end = arc(made)
    ends = [arc(scales=[1.0 + small * (at == each) for at in range(3)]) for each in range(3)]
    effects = [[(a - b) / small for a, b in zip(other, end)] for other in ends]
    expected = [sd**2 / 2 * sum(e[i] * e[j] for e in effects) for i in range(3) for j in range(i, 3)]
    assert abs(end.yaw_rad) > 0.5
    assert made.spread == pytest.approx(expected, rel=2e-3)
