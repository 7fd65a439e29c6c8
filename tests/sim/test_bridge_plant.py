"""Bridges, motors, encoders and their cables: from the board's outputs to its inputs."""

import math

import pytest

from mrl_driver.errors import ConfigError, SimulatorError
from mrl_driver.protocol.table import WIRING
from mrl_driver.robot.models import load
from sim_arduino.hardware.bridge_plant import ENCODER_PINS, motor_of, motor_params
from sim_arduino.hardware.omni3md import ADDRESS
from sim_arduino.hardware.robot_physics import Errors
from sim_arduino.hardware.wiring import Plant
from tests.models import bridged

BIT = {name: 1 << number for number, (name, _) in enumerate(WIRING)}
BRAKE = (1.0, 1.0, 1.0)


def plant_of(*wires, **options):
    return Plant(bridged(), wiring=sum(BIT[name] for name in wires), **options)


def drive(plant, left, right, seconds=1.0, share=1.0):
    """Drives the board's two motors with these signs for a time; returns the edges by pin."""
    bridge = plant.bridge
    for motor, sign in enumerate((left, right)):
        wires = (share, 1.0, 0.0) if sign > 0 else (share, 0.0, 1.0)
        bridge.write(bridge.time_s, motor, *(wires if sign else BRAKE))
    plant.advance(bridge.time_s + seconds)
    return bridge.take_edges()


def signs(values):
    return tuple((value > 0) - (value < 0) for value in values)


def counts(edges):
    """What a board counts at its two encoder inputs, which both begin low."""
    found = []
    for pins in ENCODER_PINS:
        levels, count = dict.fromkeys(pins, 0), 0
        for edge in edges:
            if edge.pin in pins:
                levels[edge.pin] = edge.level
                a, b = (levels[pin] for pin in pins)
                count += 1 if (edge.pin == pins[0]) == (a != b) else -1
        found.append(count)
    return found


def test_the_encoders_count_what_the_wheels_turned():
    plant = plant_of()
    edges = drive(plant, 1, -1, 0.5)
    expected = [round(plant.bridge.motor(wheel).travel) for wheel in (0, 1)]
    assert counts(edges) == expected
    assert expected[0] > 1000 and expected[1] < -1000


def test_edges_do_not_depend_on_the_length_of_the_steps():
    one, many = plant_of(), plant_of()
    whole = drive(one, 1, 1, 0.2)
    pieces = [edge for _ in range(200) for edge in drive(many, 1, 1, 1e-3)]
    assert whole and [edge[1:] for edge in pieces] == [edge[1:] for edge in whole]
    assert [edge.time_s for edge in pieces] == pytest.approx([edge.time_s for edge in whole], abs=1e-8)


# ---- cables


@pytest.mark.parametrize(
    ("wires", "driven", "turned", "counted"),
    [
        ("", (1, 0), (1, 0), (1, 0)),
        ("motors_swapped", (1, 0), (0, 1), (0, 1)),
        ("left_motor_reversed", (1, 1), (-1, 1), (-1, 1)),
        ("right_motor_reversed", (1, 1), (1, -1), (1, -1)),
        ("motors_swapped left_motor_reversed", (1, 1), (-1, 1), (-1, 1)),
        ("encoders_swapped", (1, 0), (1, 0), (0, 1)),
        ("encoders_swapped left_encoder_reversed", (1, 1), (1, 1), (1, -1)),
    ],
)
def test_cables_lead_outputs_to_wheels_and_encoders_to_inputs(wires, driven, turned, counted):
    """A reversal belongs to its wheel, also where the cables are swapped."""
    plant = plant_of(*wires.split())
    edges = drive(plant, *driven)
    assert signs(plant.bridge.motor(wheel).speed for wheel in (0, 1)) == turned
    assert signs(counts(edges)) == counted
    assert edges == sorted(edges)


def test_a_single_channel_has_edges_on_channel_a_only():
    plant = plant_of("single_channel")
    assert {edge.pin for edge in drive(plant, 1, 1)} == {2, 8}


def test_a_phase_error_delays_channel_b():
    """By a fifth of a count at the wheel's speed."""
    exact, late = (drive(plant_of(errors=Errors(encoder_phase=phase)), 1, 0, 0.3) for phase in (0.0, 0.2))
    ahead, behind = ([edge.time_s for edge in edges if edge.pin == 4][-1] for edges in (exact, late))
    counts_s = len(exact) / 0.3
    assert 0.05 / counts_s < behind - ahead < 0.4 / counts_s


# ---- the body and the battery


def test_a_blocked_wheel_stands_still_and_draws_the_stall_current():
    """Both motors at stall: 2 x 12.6 V / 10.5 Ohm through 0.1 Ohm."""
    plant = plant_of()
    for wheel in (0, 1):
        plant.bridge.motor(wheel).blocked = True
    rest_v = plant.bridge.battery_v
    assert drive(plant, 1, 1) == []
    stall_a = 2 * plant.bridge.battery_v / 10.5
    assert rest_v - plant.bridge.battery_v == pytest.approx(0.1 * stall_a, abs=0.01)


def test_off_pulls_all_wires_low():
    plant = plant_of()
    drive(plant, 1, 1)
    plant.bridge.off(plant.bridge.time_s)
    assert all(plant.bridge.motor(wheel).shares.coast == 1.0 for wheel in (0, 1))


def test_the_divider_brings_the_battery_to_a3():
    plant = plant_of(battery_v=11.0)
    assert plant.adc_volts(3, 0.0) == pytest.approx(11.0 / 4.0)


def test_without_a_divider_a3_is_at_ground():
    assert Plant(bridged(battery_divider=0)).adc_volts(3, 0.0) == 0.0


def test_a_smaller_wheel_counts_the_same_and_goes_less_far():
    plant = plant_of(errors=Errors(left_scale=0.96, right_scale=0.96))
    other = plant_of()
    assert counts(drive(plant, 1, 1)) == pytest.approx(counts(drive(other, 1, 1)), rel=0.01)
    assert plant.true_pose.x_m == pytest.approx(0.96 * other.true_pose.x_m, rel=0.01)


def test_the_full_speed_of_a_model_is_its_motors_no_load_speed():
    """170 turns a minute at 12 V; the bridge and rolling friction cost some of it."""
    assert motor_of(bridged()).no_load_rad_s == pytest.approx(170 * 2 * math.pi / 60)
    params = motor_params(bridged())
    no_load = 12.0 / params.volts_per_count_s - params.friction_counts_s2 * params.resistance_ohm / (
        params.counts_s2_per_a * params.volts_per_count_s
    )
    assert 160 < no_load / 1496 * 60 < 170


def test_a_robot_with_bridges_has_no_omni3md():
    plant = plant_of()
    assert ADDRESS not in plant.i2c
    with pytest.raises(SimulatorError, match="has H-bridges"):
        plant.motor_board  # noqa: B018


def test_three_wheels_are_refused():
    omni = load("omni")
    with pytest.raises(ConfigError, match="two bridges"):
        Plant(omni._replace(board={**omni.board, "bridge": 4}))
