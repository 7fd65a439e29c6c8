"""The check of an H-bridge board's wiring, the facts of the chips, and the verdicts of docs/wirings.md."""

import random
from collections import Counter

import pytest

from mrl_driver.protocol.table import BRIDGES, PARAMETER_BY_NAME, PINS, WIRING_PROBLEMS
from mrl_driver.robot import models, wiring, wirings
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, CHIPS
from mrl_driver.robot.wiring import Problem, check, in_words
from tests.models import MEGA_PINS
from tests.wirings import PAGE, random_wiring, rows

UNO, MEGA = ATMEGA328P, ATMEGA2560
DUO = wiring.of_board(models.load_packaged("duo").board)
DUO_MEGA = {wiring.short(name): pin for name, pin in MEGA_PINS.items()}


def duo(**pins):
    return {
        **DUO,
        **{f"pin_{name}" if f"pin_{name}" in wiring.PIN_NAMES else name: pin for name, pin in pins.items()},
    }


@pytest.mark.parametrize("row", [row for row in rows() if row.has_table], ids=lambda row: row.name)
def test_the_check_agrees_with_the_verdict(row):
    problem = check(row.pins, row.bridge, row.chip)
    if row.verdict == "refused":
        pin, reason = row.remark.partition(":")[0].split()
        assert (problem.name, row.chip.label(row.pins[problem.parameter])) == (reason, pin)
    else:
        assert problem == wiring.SOUND


def test_at_least_22_wirings_drive_and_each_refusal_names_its_pin():
    verdicts = Counter(row.verdict for row in rows())
    assert sum(verdicts.values()) == 32 and verdicts["drives"] >= 22
    assert all(row.remark for row in rows() if row.verdict == "refused")
    assert "{drives} drive, and {refused} are refused.".format(**verdicts) in PAGE.read_text()


@pytest.mark.parametrize(
    ("chip", "bridge", "pins", "problem"),
    [
        (UNO, "tb6612", {}, "none"),
        (UNO, "unset", {}, "none"),
        (UNO, "tb6612", {"left_logic": -1}, "not_connected left_logic"),
        (UNO, "cytron", {"left_pwm_b": -1, "right_pwm_b": -1}, "none"),
        (UNO, "l298n", {"left_pwm_a": -1}, "none"),
        (UNO, "l298n_enable", {"left_pwm_a": -1}, "not_connected left_pwm_a"),
        (UNO, "bts7960", {"left_logic": -1}, "none"),
        (UNO, "tb6612", {"right_encoder_a": -1}, "not_connected right_encoder_a"),
        (UNO, "tb6612", {"right_encoder_b": -1}, "none"),
        (UNO, "tb6612", {"right_encoder_a": -1, "no_encoders": 1}, "none"),
        (UNO, "tb6612", {"right_logic": -1, "no_encoders": 1}, "not_connected right_logic"),
        (UNO, "tb6612", {"battery": 20}, "no_such_pin battery"),
        (UNO, "tb6612", {"sonar_power": 0}, "serial_pin sonar_power"),
        (UNO, "tb6612", {"left_encoder_b": 1}, "serial_pin left_encoder_b"),
        (UNO, "tb6612", {"left_encoder_b": 7}, "pin_used_twice left_encoder_b left_logic"),
        (UNO, "tb6612", {"left_pwm_a": 4, "left_encoder_b": -1}, "no_pwm left_pwm_a"),
        (UNO, "l298n", {"left_pwm_a": 4, "left_encoder_b": -1}, "none"),
        (UNO, "drv8833", {"left_pwm_b": 4, "left_encoder_b": -1}, "no_pwm left_pwm_b"),
        (UNO, "tb6612", {"left_logic": 13, "sonar_power": -1}, "none"),
        (UNO, "cytron", {"left_pwm_b": 13, "sonar_power": -1}, "none"),
        (UNO, "l298n", {"left_pwm_a": 13, "sonar_power": -1}, "none"),
        (UNO, "l298n", {"left_logic": 13, "sonar_power": -1}, "none"),
        (UNO, "l298n", {"left_logic": 13, "left_pwm_a": -1, "sonar_power": -1}, "led_pin left_logic"),
        (MEGA, "tb6612", {"right_pwm_a": 13, "sonar_power": -1, "i2c": 0}, "led_pin right_pwm_a"),
        (UNO, "tb6612", {"left_encoder_a": 13, "sonar_power": -1}, "led_pin left_encoder_a"),
        (UNO, "tb6612", {"left_encoder_b": 13, "sonar_power": -1}, "led_pin left_encoder_b"),
        (UNO, "l298p", {"left_logic": 13, "left_pwm_b": -1, "right_pwm_b": -1, "sonar_power": -1}, "none"),
        (UNO, "l298p_brake", {"left_pwm_b": -1}, "not_connected left_pwm_b"),
        (
            UNO,
            "tb6612",
            {"range_1_trigger": 13, "range_1_echo": 10, "sonar_power": -1, "right_encoder_b": -1},
            "none",
        ),
        (
            UNO,
            "tb6612",
            {"range_1_trigger": 10, "range_1_echo": 13, "sonar_power": -1, "right_encoder_b": -1},
            "led_pin range_1_echo",
        ),
        (
            MEGA,
            "tb6612",
            {"left_encoder_a": 12, "right_encoder_a": 50, "sonar_trigger": -1},
            "no_analog sonar_front",
        ),
        (MEGA, "tb6612", {"left_encoder_a": 30}, "no_interrupt left_encoder_a"),
        (UNO, "tb6612", {"battery": 4, "left_encoder_b": -1}, "no_analog battery"),
        (UNO, "tb6612", {"range_1_echo": 17, "battery": -1}, "none"),
        (UNO, "tb6612", {"range_1_echo": 4, "left_encoder_b": -1}, "no_analog range_1_echo"),
        (UNO, "tb6612", {"range_1_echo": 18}, "bus_pin range_1_echo"),
        (UNO, "tb6612", {"range_1_trigger": 4, "left_encoder_b": -1}, "not_connected range_1_echo"),
        (
            MEGA,
            "tb6612",
            {**DUO_MEGA, "range_5_trigger": 30, "range_5_echo": 31},
            "no_interrupt range_5_echo",
        ),
        (MEGA, "tb6612", {**DUO_MEGA, "range_5_trigger": 30, "range_5_echo": 21, "i2c": 0}, "none"),
        (UNO, "tb6612", {"left_encoder_b": 18}, "bus_pin left_encoder_b"),
        (UNO, "tb6612", {"left_encoder_b": 18, "i2c": 0}, "none"),
        (UNO, "drv8833", {"left_pwm_a": 9, "right_logic": -1}, "no_clock left_pwm_a"),
        (UNO, "bts7960", {"left_pwm_a": 9, "right_logic": -1}, "none"),
        (UNO, "cytron", {"servo_1": 9, "right_logic": 10, "right_encoder_b": -1}, "none"),
        (UNO, "cytron", {"servo_2": 6, "left_pwm_b": -1}, "no_servo servo_2"),
        (
            UNO,
            "cytron",
            {"servo_1": 10, "right_pwm_a": 9, "right_logic": 11, "right_encoder_b": -1},
            "no_servo servo_1",
        ),
        (UNO, "tb6612", {"servo_1": 10, "right_encoder_b": -1}, "no_clock servo_1"),
        (UNO, "tb6612", {"servo_1": 10, "right_encoder_b": -1, "right_pwm_a": 6, "left_pwm_b": 11}, "none"),
        (UNO, "tb6612", {"servo_1": 9}, "pin_used_twice servo_1 right_logic"),
    ],
    ids=lambda each: each.name if hasattr(each, "name") else str(each),
)
def test_problems_and_their_pins(chip, bridge, pins, problem):
    name, *parameters = problem.split()
    assert check(duo(**pins), bridge, chip) == Problem(name, *(f"pin_{each}" for each in parameters))


def test_every_problem_can_happen():
    chance, unseen = random.Random(1), {name for name, _ in WIRING_PROBLEMS}
    for _ in range(5000):
        chip = chance.choice((UNO, MEGA))
        pins, bridge = random_wiring(chance, chip)
        unseen.discard(check(pins, bridge, chip).name)
        if not unseen:
            break
    assert not unseen


@pytest.mark.parametrize("chip", CHIPS.values(), ids=CHIPS)
def test_a_sound_wiring_gives_each_function_a_pin_that_can_do_it(chip):
    chance = random.Random(2)
    for _ in range(1000):
        pins, bridge = random_wiring(chance, chip)
        if bridge == "unset" or check(pins, bridge, chip) != wiring.SOUND:
            continue
        used = [pin for name, pin in pins.items() if pin != -1 and name in wiring.PIN_NAMES]
        assert len(set(used)) == len(used) and not set(used) & {0, 1} and max(used) < len(chip.pins)
        assert not (pins[wiring.I2C] and set(used) & set(chip.bus))
        for wires in wiring.output_pins(pins):
            assert all(chip.pins[wires[each]].timer >= 0 for each in wiring.BRIDGE_WIRES[bridge].pwm)
        assert pins[wiring.NO_ENCODERS] or all(chip.pins[a].interrupts for a, _ in wiring.encoder_pins(pins))


def test_a_problem_has_pin_and_reason_in_words():
    assert in_words(wiring.SOUND, DUO, UNO) == ""
    for pins, words in (
        ({"left_encoder_b": 7}, "left_encoder_b is on D7, as left_logic: another function has the same pin"),
        ({"left_logic": -1}, "left_logic is not connected: the bridge, the encoder or the HC-SR04 needs this pin"),
        ({"right_pwm_a": 14, "sonar_front": -1}, "right_pwm_a is on A0: the function needs PWM, and no timer makes "
                                                 "it on this pin"),
    ):  # fmt: skip
        table = duo(**pins)
        assert in_words(check(table, "tb6612", UNO), table, UNO) == words


def test_a_reply_of_the_board_is_the_problem():
    problem = Problem("pin_used_twice", "pin_battery", "pin_left_logic")
    numbers = (PARAMETER_BY_NAME[name].number for name in ("pin_battery", "pin_left_logic"))
    assert problem.reply == (4, *numbers) and wiring.from_reply(*problem.reply) == problem
    assert wiring.from_reply(0, -1, -1) == wiring.SOUND
    assert wiring.NAMES == tuple(row.name for row in PINS)


@pytest.mark.parametrize("bridge", BRIDGES[1:])
def test_each_bridge_has_wires_with_pwm_among_those_it_needs(bridge):
    wires = wiring.BRIDGE_WIRES[bridge]
    assert wires.pwm and set(wires.pwm) <= set(wires.needed)


def test_pins_of_both_chips():
    """As in the data sheets and on the boards: PWM, external and pin-change interrupts, the bus."""
    timers = {number: pin.timer for number, pin in enumerate(UNO.pins) if pin.timer >= 0}
    assert timers == {3: 2, 5: 0, 6: 0, 9: 1, 10: 1, 11: 2} and all(pin.interrupts for pin in UNO.pins)
    timers = {number: pin.timer for number, pin in enumerate(MEGA.pins) if pin.timer >= 0}
    assert timers == {
        2: 3,
        3: 3,
        4: 0,
        5: 3,
        6: 4,
        7: 4,
        8: 4,
        9: 2,
        10: 2,
        11: 1,
        12: 1,
        13: 0,
        44: 5,
        45: 5,
        46: 5,
    }
    followed = [number for number, pin in enumerate(MEGA.pins) if pin.interrupts and number > 1]
    assert followed == [2, 3, *range(10, 16), *range(18, 22), *range(50, 54), *range(62, 70)]
    for chip in CHIPS.values():
        assert len({pin[:2] for pin in chip.pins}) == len(chip.pins)
        assert all(chip.number(chip.label(number)) == number for number in range(len(chip.pins)))
    assert (UNO.number("A4"), UNO.number("a6"), UNO.number("20"), MEGA.number("A8")) == (18, None, None, 62)


@pytest.mark.parametrize("name", wirings.names())
def test_each_wiring_of_the_catalogue_is_sound_and_names_its_source(name):
    entry = wirings.load(name)
    for bridge in [entry.bridge] if entry.bridge else BRIDGES[1:]:
        assert check(entry.pins, bridge, entry.chip) == wiring.SOUND
    assert entry.title and entry.source and (name != "mrl_duo" or entry.pins == DUO)
