"""Boards with four motors: what each wheel does, what the frames for two wheels say of them, and what stops all."""

import math

import pytest

from mrl_driver.protocol import encode_request
from mrl_driver.protocol.table import BY_NAME, WHEELS, WIRING
from tests.models import four_wheels

from .bench import STEP_S

BITS = {name: 1 << bit for bit, (name, _) in enumerate(WIRING)}
DRIVE_S, SPEED_M_S = 1.0, 0.01
ALL = [True] * 4
MEASURED = {"battery_divider": 3000, "undervoltage": 1000, "pin_bumper_left": 30, "pin_emergency_stop": 31}


@pytest.fixture(params=["avr", "pc", "python"])
def engine(request):
    return request.param


@pytest.fixture
def make(benches):
    return lambda kind="mecanum", **options: benches("bridge", robot=four_wheels(kind), **options)


@pytest.fixture
def bench(make):
    return make()


def speeds(bench):
    """Speeds of the wheels [m/s], in the order of the wiring."""
    metres = bench.model.drive.metres_per_count
    wheels = range(len(bench.plant.bridge.outputs))
    return [bench.plant.bridge.motor(wheel).speed * metres for wheel in wheels]


def test_a_board_says_that_it_has_four_motors(bench):
    assert bench.reply("read_board") == (2560, 4, 2, 0, 0, 0)
    assert bench.reply("read_wiring") == (0, -1, -1) and bench.status().faults == 0


ARM_M = 0.135  # half of track and wheelbase


@pytest.mark.parametrize(
    ("request_", "signs"),
    [
        (("move_twist", 200, 0, 0), (0.2, 0.2, 0.2, 0.2)),
        (("move_twist", 0, 200, 0), (-0.2, 0.2, 0.2, -0.2)),
        (("move_twist", 100, 100, 0), (0.0, 0.2, 0.2, 0.0)),
        (("move_twist", 0, 0, 1000), (-ARM_M, ARM_M, -ARM_M, ARM_M)),
        (("move_differential", 100, 1000), (0.1 - ARM_M, 0.1 + ARM_M, 0.1 - ARM_M, 0.1 + ARM_M)),
        (("move_motors_pid", 20, -30), (0.116, -0.174, 0.116, -0.174)),
    ],
    ids=str,
)
def test_a_move_turns_each_wheel(bench, request_, signs):
    bench.ask(*request_, wait_s=DRIVE_S)
    assert speeds(bench) == pytest.approx(signs, abs=SPEED_M_S)


@pytest.mark.parametrize("wheel", range(4), ids=WHEELS)
def test_one_motor_turns_alone(bench, wheel):
    bench.ask("move_wheels", *(30 * (each == wheel) for each in range(4)), wait_s=0.5)
    assert bench.driven() == [each == wheel for each in range(4)]
    assert [count > 100 for count in bench.reply("read_wheels")[:4]] == bench.driven()


def test_frames_for_two_wheels_have_the_mean_of_each_side(bench):
    bench.ask("move_wheels", 20, 30, 40, 50, wait_s=0.5)
    bench.ask("stop", wait_s=0.5)
    left, right, rear_left, rear_right, *others = bench.reply("read_wheels")
    assert left < right < rear_left < rear_right and others == [0, *[-1] * 6]
    assert bench.reply("read_encoders") == ((right + rear_right) // 2, (left + rear_left) // 2)


def test_presets_belong_to_a_side_alone(bench):
    bench.ask("move_differential", 200, 0, wait_s=0.5)
    bench.ask("stop", wait_s=0.5)
    before = bench.reply("read_wheels")
    bench.ask("preset_encoder", 1, 1000)
    bench.ask("reset_encoders")
    assert bench.reply("read_encoders") == (0, 0) and bench.reply("read_wheels") == before


def test_a_side_turns_to_its_position(bench):
    bench.ask("move_to_position", 3, 50, 700, wait_s=3.0)
    assert bench.reply("read_wheels")[:4] == pytest.approx((0, 700, 0, 700), abs=5)


def test_a_stream_repeats_all_counters(bench):
    bench.ask("set_check", 1)
    events = bench.ask("start_wheel_stream", 20, wait_s=0.21)
    assert {(event.code, len(event.args), event.stamp is None) for event in events} == {(54, 11, False)}
    assert len(events) == pytest.approx(11, abs=1)
    bench.ask("stop_wheel_stream")
    assert bench.ask("stop_wheel_stream", wait_s=0.1) == []


@pytest.mark.parametrize("request_", [("move_twist", 100, 0, 0), ("move_wheels", 30, 30, 30, 30)], ids=str)
def test_a_move_needs_a_checksum_once_the_host_has_turned_them_on(bench, request_):
    name, *args = request_
    bench.ask("set_check", 1)
    bench.send(encode_request(BY_NAME[name].code, *args))
    assert not bench.is_driven() and bench.counters() == {"bad_check": 1}
    bench.ask(name, *args)
    assert bench.is_driven()


@pytest.mark.parametrize(
    "names",
    [
        ("rear_left_motor_reversed", "rear_right_encoder_reversed"),
        ("rear_left_encoder_reversed", "rear_right_motor_reversed", "motors_swapped"),
        ("single_channel",),
    ],
    ids="+".join,
)
def test_wires_that_the_board_knows_drive_the_right_wheels(make, names):
    wiring = 1 + sum(BITS[name] for name in names)
    bench = make(wiring=wiring, stored={"wiring": wiring})
    bench.ask("move_twist", 0, 200, 0, wait_s=DRIVE_S)
    assert speeds(bench) == pytest.approx((-0.2, 0.2, 0.2, -0.2), abs=SPEED_M_S)
    assert [count > 0 for count in bench.reply("read_wheels")[:4]] == [False, True, True, False]


@pytest.mark.parametrize(("forward", "left"), [(300, 400), (-300, 400), (0, -500), (32767, -32768)])
def test_a_ceiling_holds_in_every_direction(make, forward, left):
    bench = make(stored={"linear_ceiling": 250})
    bench.ask("move_twist", forward, left, 0, wait_s=DRIVE_S)
    share = 0.25 / math.hypot(forward, left)
    wanted = [(forward + sign * left) * share for sign in (-1, 1, 1, -1)]
    assert speeds(bench) == pytest.approx(wanted, abs=SPEED_M_S)
    assert bench.status().clamped == 1


def test_a_twist_beyond_full_speed_slows_all_wheels_down_alike(make):
    bench = make(stored={"linear_ceiling": 32767, "angular_ceiling": 32767})
    bench.ask("move_twist", 400, 400, 0, wait_s=DRIVE_S)
    assert speeds(bench) == pytest.approx((0.0, 0.579, 0.579, 0.0), abs=5 * SPEED_M_S)


def test_a_wheel_out_of_four_without_an_encoder_is_refused(make):
    bench = make(stored={"pin_rear_right_encoder_a": -1})
    assert bench.reply("read_wiring")[0] == 1 and bench.ask("move_twist", 100, 0, 0) == []
    assert bench.counters() == {"unavailable": 1}


# ---- what stops all motors


def _host(bench):
    bench.ask("stop")


def _watchdog(bench):
    bench.ask("set_watchdog", 250)


def _rear_wheel_blocked(bench):
    bench.plant.bridge.motor(2).blocked = True


def _rear_encoder_oscillates(bench):
    bench.plant.bridge.encoders[3].open(0, True, 100e3)


def _undervoltage(bench):
    bench.plant.robot.sag(4.0)


def _bumper(bench):
    bench.plant.bridge.inputs.pressed = {"bumper_left"}


def _emergency_stop(bench):
    bench.plant.bridge.inputs.pressed = {"emergency_stop"}


RESET_S = 0.1
"""A chip that resets itself after a hung loop answers after this time."""


def _hung_loop(bench):
    bench.now_s += 0.3
    bench.board.gap(bench.now_s, b"")


@pytest.mark.parametrize(
    ("cause", "reason", "limit_s"),
    [
        (_hung_loop, "stall boot", 0.01),  # the chip resets itself
        (_host, "host", 0.001),
        (_watchdog, "link_watchdog", 0.3),
        (_rear_wheel_blocked, "wheel_blocked", 2.0),
        (_rear_encoder_oscillates, "encoder", 0.1),
        (_undervoltage, "undervoltage", 0.4),
        (_bumper, "bumper", 0.006),
        (_emergency_stop, "emergency_stop", 0.006),
    ],
)
def test_a_stop_is_one_of_all_motors(make, cause, reason, limit_s):
    bench = make(board=MEASURED)
    bench.ask("move_twist", 200, 0, 0, wait_s=0.3)
    assert bench.driven() == ALL
    cause(bench)
    bench.run_until_released(limit_s + STEP_S)
    bench.run(RESET_S)
    assert bench.driven() == [False] * 4 and bench.stop_reason() in reason.split()


def test_a_wrong_encoder_at_the_rear_stops_all_motors(make):
    bench = make(wiring=1 + BITS["rear_left_encoder_reversed"])
    bench.ask("move_twist", 200, 0, 0, wait_s=0.02)
    bench.run_until_released(0.4)
    assert bench.stop_reason() == "encoder"


# ---- boards with two motors


def test_a_mega_with_two_motors_takes_what_two_can_do(benches):
    rear = {name: -1 for name in four_wheels("skid").board if name.startswith("pin_rear")}
    bench = benches("bridge", robot=four_wheels("skid"), board=rear)
    assert bench.reply("read_board")[:3] == (2560, 2, 2)
    bench.ask("move_twist", 200, 0, 0, wait_s=DRIVE_S)
    assert speeds(bench) == pytest.approx((0.2, 0.2), abs=SPEED_M_S)
    assert bench.ask("move_twist", 0, 100, 0) == bench.ask("move_wheels", 10, 10, 10, 10) == []
    assert bench.counters() == {"unavailable": 2}
