"""The pins of H-bridge boards: which wirings drive, what a board says of one that cannot, and who has no pins."""

import pytest

from mrl_driver.protocol.table import BRIDGES, BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from tests.models import model
from tests.wirings import rows

PINS = wiring.rows(ATMEGA328P)
DRIVEN = [row for row in rows() if row.verdict == "drives"]
MOVE, DRIVE_S = ("move_differential", 150, 0), 0.8


def number(name):
    return PARAMETER_BY_NAME[f"pin_{name}"].number


def drives(bench):
    """Whether a move turns both wheels forward, and both encoders count that, if there are any."""
    counts = not bench.plant.model.board["no_encoders"]
    before = bench.reply("read_encoders")
    bench.ask(*MOVE, wait_s=DRIVE_S)
    after = bench.reply("read_encoders")
    wheels = bench.wheels()
    bench.ask("stop")
    return min(wheels) > 0.02 and all((b - a > 50) == counts for a, b in zip(before, after))


def coasting(bench):
    """Shares of time for which no current can flow through the motors."""
    bench.run(0.01)
    return [bench.plant.bridge.motor(wheel).shares.coast for wheel in (0, 1)]


@pytest.mark.parametrize("row", DRIVEN, ids=lambda row: row.name)
def test_a_wiring_drives(make, row):
    robot = model("duo")._replace(chip=row.chip.name)
    bench = make(robot=robot, board={"bridge": BRIDGES.index(row.bridge), **row.pins})
    assert bench.reply("read_wiring") == (0, -1, -1) and bench.status().faults == 0
    assert drives(bench)


@pytest.mark.parametrize(
    ("pins", "reply"),
    [
        ({row.name: -1 for row in PINS if row.low == -1}, (1, number("left_pwm_a"), -1)),
        ({"pin_battery": -1, "pin_range_1_trigger": 17}, (1, number("range_1_echo"), -1)),
        ({"pin_left_logic": 20}, (2, number("left_logic"), -1)),
        ({"pin_battery": 1}, (3, number("battery"), -1)),
        ({"pin_left_encoder_b": 7}, (4, number("left_encoder_b"), number("left_logic"))),
        ({"pin_left_pwm_a": 12, "pin_sonar_trigger": 5}, (5, number("left_pwm_a"), -1)),
        ({"pin_right_encoder_b": 13, "pin_sonar_power": -1}, (6, number("right_encoder_b"), -1)),
        ({"pin_right_logic": 19}, (9, number("right_logic"), -1)),
        ({"pin_emergency_stop": 13, "pin_sonar_power": -1}, (6, number("emergency_stop"), -1)),
    ],
    ids=["nothing", "no echo", "20", "serial", "twice", "no PWM", "LED", "bus", "input with LED"],
)
def test_a_wiring_that_the_chip_cannot_do_refuses_every_move(make, pins, reply):
    """Until it is mended; then the board drives, without a reset."""
    bench = make(stored=pins)
    assert bench.reply("read_wiring") == reply
    assert bench.ask(*MOVE, wait_s=0.1) == [] and not bench.is_driven()
    for name in pins:
        bench.ask("write_config", PARAMETER_BY_NAME[name].number, bench.plant.model.board[name])
    assert bench.reply("read_wiring") == (0, -1, -1) and drives(bench)


def test_a_wiring_that_breaks_while_the_robot_drives_stops_it(bench):
    bench.ask(*MOVE, wait_s=DRIVE_S)
    bench.ask("write_config", number("left_encoder_a"), -1)
    assert not bench.is_driven() and bench.reply("read_wiring") == (1, number("left_encoder_a"), -1)
    assert bench.ask(*MOVE, wait_s=0.1) == [] and not bench.is_driven()


@pytest.mark.parametrize("name, value", [("wiring", 1), ("servo_release", 1)])
def test_a_write_of_the_wiring_does_not_let_the_robot_move_after_a_stop_of_the_board(bench, name, value):
    """It stops the motors, but it is not the stop (13) for which the board waits."""
    bench.ask("set_watchdog", 60)
    bench.ask(*MOVE, wait_s=0.1)
    bench.write_config(name, value)
    (status,) = bench.ask(*MOVE)
    assert status.code == BY_NAME["read_status"].code and not bench.is_driven()
    bench.ask("stop")
    bench.ask(*MOVE)
    assert bench.is_driven()


@pytest.mark.parametrize("name", ["pin_enable_1", "pin_enable_2"])
def test_an_enable_is_high_while_the_robot_may_be_driven(make, name):
    """Without it the motors coast; the bridge itself can only brake."""
    cytron = {"bridge": BRIDGES.index("cytron"), "pin_sonar_trigger": -1, name: 12}
    bench = make(board=cytron, stored={"wiring": 0})
    bench.run(0.1)
    assert coasting(bench) == [1.0, 1.0]
    bench.ask("write_config", PARAMETER_BY_NAME["wiring"].number, 1)
    assert coasting(bench) == [0.0, 0.0] and drives(bench)
    assert coasting(bench) == [0.0, 0.0]
    bench.ask("write_config", number("left_pwm_a"), -1)
    assert coasting(bench) == [1.0, 1.0]


def test_the_pins_are_kept_and_defaults_leave_them(bench):
    bench.ask("write_config", number("battery"), -1)
    bench.ask("default_config")
    bench.ask("save_config", wait_s=0.6)
    bench.brown_out()
    bench.run(0.3)
    kept = [bench.reply("read_config", row.number)[1] for row in PINS]
    board = {**bench.plant.model.board, "pin_battery": -1}
    assert kept == [board[row.name] if row.name in board else wiring.EMPTY[row.name] for row in PINS]


def test_other_boards_have_no_pins(omni3md):
    assert omni3md.ask("read_config", PINS[0].number) == omni3md.ask("write_config", PINS[0].number, 5) == []
    assert omni3md.ask("read_wiring") == []
    assert omni3md.counters() == {"argument_range": 2, "unavailable": 1}


# ---- motors without encoders

OPEN_LOOP = {
    **{f"pin_{side}_encoder_{each}": -1 for side in ("left", "right") for each in "ab"},
    "no_encoders": 1,
}


def test_a_forgotten_encoder_is_a_problem(make):
    forgotten = make(board={**OPEN_LOOP, "no_encoders": 0})
    assert forgotten.reply("read_wiring") == (1, number("left_encoder_a"), -1)


@pytest.fixture
def open_loop(make):
    return make(board=OPEN_LOOP)


def test_no_wheel_is_watched_that_nothing_counts(open_loop):
    """At full speed, long after a silent encoder would have stopped it."""
    for _ in range(10):
        open_loop.ask("move_motors_pid", 100, 100, wait_s=0.1)
    assert min(open_loop.wheels()) > 0.5 * open_loop.full_speed_m_s()
    assert open_loop.reply("read_encoders") == (0, 0) and open_loop.status().faults == 0
    assert open_loop.reply("read_board")[:3] == (328, 2, 0)


def test_the_host_stops_a_robot_without_encoders(open_loop):
    open_loop.ask("move_motors_pid", 100, 100, wait_s=0.3)
    open_loop.ask("stop")
    assert not open_loop.is_driven()


def test_the_watchdog_stops_a_robot_without_encoders(open_loop):
    open_loop.ask("set_watchdog", 200)
    open_loop.ask(*MOVE, wait_s=0.15)
    assert open_loop.is_driven()
    open_loop.run(0.2)
    assert not open_loop.is_driven() and open_loop.stop_reason() == "link_watchdog"


def test_positions_that_nothing_counts_are_refused(open_loop):
    open_loop.ask("move_to_position", 1, 50, 1000, wait_s=0.1)
    assert not open_loop.is_driven() and open_loop.counters()["unavailable"] == 1
