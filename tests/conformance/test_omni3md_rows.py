"""Boards with an OMNI-3MD: what reaches the motor board, what it reports, and what happens without it."""

import pytest

from sim_arduino.hardware.motor import Mode

I2C_S = 0.3


@pytest.mark.parametrize(
    "name, args, reached",
    [
        ("calibrate", (), [(0xFB, 1, 1, 1)]),
        ("set_pid_gains", (900, 300, 10), [(0xF4, 900, 300, 10)]),
        ("set_encoder_prescaler", (3, 1), [(0xF0, 3, 1)]),
        ("preset_encoder", (1, -5), [(0xEF, 1, -5)]),
        ("move_motors_pid", (40, -30), [(0xF8, 40, 0, -30)]),
        ("move_motors", (-40, 30), [(0xF7, -40, 0, 30)]),
        ("move_differential", (500, -800), [(0xEB, 500, -800)]),
        ("move_differential", (-1, 0), [(0xEB, -1, 0)]),
        ("move_to_position", (3, 50, -1000), [(0xEE, 3, 50, -1000, 1)]),
        ("stop", (), [(0xFC,)]),
        ("reset_encoders", (), [(0xEF, 1, 0), (0xEF, 2, 0), (0xEF, 3, 0)]),
    ],
)
def test_reaches_the_motor_board(bench, name, args, reached):
    assert bench.ask(name, *args, wait_s=0.08) == []
    assert bench.commands() == reached


def test_set_up_of_the_motor_board(make):
    """Boot stops the motors, then tells geometry, gains, ramp, I2C timeout, and one count a pulse."""
    bench = make(wake=False)
    bench.run(0.4)
    assert bench.commands() == [
        (0xFC,),
        (0xEA, 8700, 2700, 437, 640),
        (0xF4, 700, 400, 200),
        (0xEC, 2500, 0),
        (0xF1, 3),
        *((0xF0, encoder, 0) for encoder in (1, 2, 3)),
    ]


def test_set_up_respects_the_motor_boards_eeprom(make):
    assert make().plant.motor_board.too_early == 0


# ---- without a motor board


@pytest.mark.parametrize(
    "name, args",
    [
        ("calibrate", ()),
        ("set_pid_gains", (1, 1, 1)),
        ("set_encoder_prescaler", (1, 0)),
        ("preset_encoder", (1, 0)),
        ("move_motors_pid", (1, 1)),
        ("move_motors", (1, 1)),
        ("move_differential", (1, 1)),
        ("move_to_position", (1, 1, 1)),
        ("stop", ()),
        ("read_encoders", ()),
        ("read_encoders_and_sonars", ()),
    ],
)
def test_without_a_motor_board_nothing_is_answered_and_the_refusal_is_counted(make, name, args):
    bench = make(wake=False)
    bench.plant.motor_board.present = False
    bench.run(0.4)
    assert bench.ask(name, *args) == []
    assert bench.counters() == {"unavailable": 1}


def test_a_lost_motor_board_stops_its_motors_after_its_own_timeout(bench):
    bench.ask("move_differential", 300, 0, wait_s=0.3)
    bench.plant.motor_board.present = False
    bench.run(I2C_S - 0.05)
    assert bench.plant.robot.motors[0].mode is Mode.SPEED
    bench.run(0.1)
    assert bench.plant.robot.motors[0].mode is Mode.BRAKE


def test_a_motor_board_that_comes_back_is_stopped_and_set_up(bench):
    bench.plant.motor_board.present = False
    bench.ask("read_encoders", wait_s=0.3)
    bench.plant.motor_board.present = True
    bench.run(0.3)
    bench.ask("read_encoders")
    codes = [command[0] for command in bench.commands()]
    assert codes == [0xFC, 0xEA, 0xF4, 0xEC, 0xF1, 0xF0, 0xF0, 0xF0]


def lose(bench):
    bench.plant.motor_board.present = False
    bench.ask("read_encoders", wait_s=0.3)


def prescalers_of_one_that_comes_back(bench):
    bench.commands()
    bench.plant.motor_board.present = True
    bench.run(0.3)
    return [command[1:] for command in bench.commands() if command[0] == 0xF0]


@pytest.mark.parametrize("name, args, left", [("get_stream", (), 1), ("set_check", (1,), 0)])
def test_a_motor_board_that_comes_back_gets_its_prescalers_unless_a_session_has_begun(
    bench, name, args, left
):
    """It may be another one."""
    bench.ask("set_encoder_prescaler", 3, 1, wait_s=0.1)
    lose(bench)
    bench.ask(name, *args)
    assert prescalers_of_one_that_comes_back(bench) == [(1, 0), (2, 0), (3, left)]


def test_a_prescaler_that_was_refused_is_forgotten(bench):
    lose(bench)
    bench.ask("set_encoder_prescaler", 3, 1)
    assert prescalers_of_one_that_comes_back(bench) == [(1, 0), (2, 0), (3, 0)]


@pytest.mark.parametrize(
    "name, args, told",
    [
        ("set_encoder_prescaler", (3, 1), []),
        ("set_check", (0,), [(0xF0, 3, 0)]),
        ("set_check", (1,), [(0xF0, 3, 0)]),
    ],
)
def test_a_prescaler_that_is_known_is_not_written_again(bench, name, args, told):
    """Each time would write the motor board's EEPROM."""
    bench.ask("set_encoder_prescaler", 3, 1, wait_s=0.1)
    bench.commands()
    for _ in range(2):
        bench.ask(name, *args)
    assert bench.commands() == told


# ---- three wheels across


def test_three_wheels_move_sideways_and_turn(make):
    """To the left while it turns: what reaches the motor board, and where the robot goes."""
    bench = make(robot="omni")
    assert bench.ask("move_omni", 40, -5, 90, wait_s=2.0) == []
    assert bench.commands() == [(0xFA, 40, -5, 90)]
    pose = bench.plant.true_pose
    assert pose.y_m > 0.2 and pose.yaw_rad < -0.2


@pytest.mark.parametrize(
    "asked, told",
    [
        ((100, 0, 90), (50, 0, 90)),
        ((50, 40, 0), (50, 40, 0)),
        ((100, -40, 0), (50, -20, 0)),
        ((40, -80, 359), (20, -40, 359)),
        ((0, 100, 0), (0, 40, 0)),
    ],
)
def test_omni_moves_keep_below_the_ceilings(make, asked, told):
    """Ceilings of half of full speed and two fifths of full rotation: both shares shrink alike, and are counted."""
    bench = make(robot="omni")
    bench.write_config("linear_ceiling", 252)  # full speed is 160 / 60 * 2 pi * 30 mm = 502.65 mm/s
    bench.write_config("angular_ceiling", 2011)  # at 100 mm from the middle
    bench.ask("move_omni", *asked)
    assert bench.commands() == [(0xFA, *told)]
    assert bench.status().clamped == (asked != told)


def test_omni_stream_carries_three_counters_until_the_stop(make):
    """Each counter at its place, then the sonars; row 19 ends it."""
    bench = make(robot="omni")
    for encoder, count in ((1, 111), (2, -222), (3, 333)):
        bench.ask("preset_encoder", encoder, count)
    events = bench.ask("start_omni_stream", 20, wait_s=0.1)
    assert {(event.code, event.args[:3]) for event in events} == {(44, (333, 111, -222))}
    assert 4 <= len(events) <= 6 and len(events[0].args) == 6
    bench.ask("stop_stream")
    assert bench.run(0.1) == b""


def test_omni_moves_end_with_the_watchdog(make):
    """As any other move: silence stops the motors, and the board says why."""
    bench = make(robot="omni")
    assert bench.reply("set_watchdog", 250) == (250,)
    bench.ask("move_omni", 30, 0, 45, wait_s=0.6)
    assert bench.commands()[-2:] == [(0xFA, 30, 0, 45), (0xFC,)]
    assert bench.status().stop_reason == 2


# ---- the board itself


def test_robot_info(make):
    bench = make(robot="stingbot", battery_v=11.4)
    assert bench.reply("robot_info") == (2500, 172, 1140, 2, 4)


@pytest.mark.parametrize(
    "name, value, reached",
    [
        ("axis_radius", 9000, (0xEA, 9000, 2700, 437, 640)),
        ("kp", 800, (0xF4, 800, 400, 200)),
        ("ramp_time", 1000, (0xEC, 1000, 0)),
        ("motor_timeout", 5, (0xF1, 5)),
    ],
)
def test_the_motor_board_is_told_what_concerns_it(bench, name, value, reached):
    bench.write_config(name, value)
    assert bench.commands() == [reached]


def test_a_motor_board_that_goes_and_comes_is_told_though_nobody_asked_it(bench):
    bench.plant.motor_board.present = False
    bench.run(0.2)
    assert bench.status().faults == 1
    bench.commands()
    bench.plant.motor_board.present = True
    bench.run(0.4)
    assert (0xFC,) in bench.commands()
