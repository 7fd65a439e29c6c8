"""Injected faults of line, encoders, wheels, battery, sonars and IMU: each does what it says, when it should."""

import math
import random
import weakref
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.protocol import REPLIES, REQUESTS, Frame, FrameDecoder, encode_reply, encode_request
from mrl_driver.protocol.table import STOP_CODE
from mrl_driver.robot.inputs import READ_INPUTS
from sim_arduino.board import PythonBoard
from sim_arduino.faults.fault_table import FAULTS, parse
from sim_arduino.faults.faulty_engine import FaultyEngine, Window
from sim_arduino.hardware.wiring import Plant
from tests.models import WITH_INPUTS, bridged, four_wheels, model

PLENTY = bytes(range(256)) * 400
INSTANT = ("loss", "flip", "change", "repeat", "swap")


class Echo:
    """An engine that sends back what it gets, and notes what is done to it."""

    next_event_s = math.inf

    def __init__(self):
        self.out, self.calls = b"", []

    def receive(self, data):
        self.out += data

    def advance(self, to_s):
        out, self.out = self.out, b""
        return out

    def gap(self, to_s, waiting):
        self.calls.append(("gap", to_s, waiting))

    def reset(self):
        self.calls.append(("reset",))


def make(name, seed=1, **values):
    kind = FAULTS[name]
    defaults = {p.name: p.default for p in kind.parameters}
    return kind.make(random.Random(seed), **{**defaults, **values})


def passed(engine, times):
    return [engine.advance(time_s) for time_s in times]


def test_lost_bytes_are_as_many_as_said():
    lost = 1 - len(make("loss", rate=0.01).run(PLENTY, 0.0)) / len(PLENTY)
    assert lost == pytest.approx(0.01, rel=0.15)


def test_a_burst_loses_bytes_in_a_row():
    out = make("loss", rate=1.0, burst=7).run(b"0123456789", 0.0)
    assert out == b""
    few = make("loss", rate=0.0005, burst=20).run(PLENTY, 0.0)
    assert (len(PLENTY) - len(few)) % 20 == 0


def test_a_flip_changes_one_bit():
    out = make("flip", rate=0.01).run(PLENTY, 0.0)
    bits = {bin(a ^ b).count("1") for a, b in zip(PLENTY, out)}
    assert bits == {0, 1}
    assert len(out) == len(PLENTY)


def test_a_swapped_byte_comes_after_its_neighbour():
    """At the full rate the first byte changes places with each that follows."""
    fault = make("swap", rate=1.0)
    assert fault.run(b"abcd", 0.0) + fault.empty() == b"bcda"


def test_a_swapped_byte_without_a_neighbour_comes_by_itself_after_10_ms():
    engine = FaultyEngine(Echo(), ["swap:rate=1,direction=to_host"])
    engine.receive(b"ab")
    assert passed(engine, [0.0, 0.009, 0.011]) == [b"b", b"", b"a"]


def test_a_repeated_frame_comes_whole_and_twice():
    fault = make("repeat", rate=1.0)
    assert fault.run(b"@6,1,", 0.0) + fault.run(b"2e\r\n", 0.0) == b"@6,1,2e@6,1,2e\r\n"


@pytest.mark.parametrize("name", INSTANT)
@given(cuts=st.lists(st.integers(0, 500), max_size=20))
def test_the_same_bytes_are_hit_however_they_are_cut(name, cuts):
    data = b"@6,123,456e\r\n" * 40
    bounds = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    whole, fault = make(name, rate=0.1), make(name, rate=0.1)
    pieces = [fault.run(data[a:b], 0.0) for a, b in zip(bounds, bounds[1:])]
    assert b"".join(pieces) + fault.empty() == whole.run(data, 0.0) + whole.empty()


def test_a_delay_keeps_order_and_bounds():
    engine = FaultyEngine(Echo(), ["delay:delay=0.1,jitter=0.05,direction=to_board"], seed=3)
    came = b""
    for i in range(100):
        engine.receive(bytes([i]))
        came += engine.advance((i + 1) * 0.01)
        assert max(0, i + 1 - 16) <= len(came) <= max(0, i + 1 - 9)
    assert came == bytes(range(len(came)))


def test_pieces_are_small_and_apart():
    engine = FaultyEngine(Echo(), ["split:size=1,gap=0.003,direction=to_host"])
    engine.receive(b"abc")
    assert passed(engine, [0.001, 0.0035, 0.004, 0.0065, 1.0]) == [b"a", b"", b"b", b"", b"c"]


def test_a_stalled_line_lets_go_at_once():
    engine = FaultyEngine(Echo(), ["stall:at=1,lasts=2,direction=to_host"])
    passed(engine, [1.5])
    engine.receive(b"abc")
    assert passed(engine, [2.9, 3.0]) == [b"", b"abc"]


def test_nothing_passes_a_pulled_cable():
    engine = FaultyEngine(Echo(), ["unplug:at=1,lasts=1"])
    engine.advance(1.0)
    engine.receive(b"abc")
    assert (engine.plugged, passed(engine, [1.5])) == (False, [b""])
    engine.advance(2.0)
    engine.receive(b"def")
    assert (engine.plugged, passed(engine, [2.5])) == (True, [b"def"])


def test_what_was_on_the_way_is_lost_with_the_cable():
    engine = FaultyEngine(Echo(), ["delay:delay=1"])
    engine.receive(b"abc")
    engine.unplug(0.5)
    plugged = []
    for time_s in (0.4, 0.5):
        engine.advance(time_s)
        plugged.append(engine.plugged)
    assert (plugged, passed(engine, [5.0])) == ([False, True], [b""])


def test_a_frozen_board_gets_what_waited_as_a_gap():
    engine = FaultyEngine(Echo())
    engine.advance(1.0)
    engine.freeze(5.0)
    engine.advance(1.1)
    engine.receive(b"@11,500,0e")
    engine.advance(7.0)
    assert engine.engine.calls == [("gap", 6.0, b"@11,500,0e")]


def test_a_reset_that_is_injected_comes_though_the_board_has_nothing_to_do_meanwhile():
    engine = FaultyEngine(Echo())
    engine.advance(1.0)
    engine.inject("reset:at=0")
    engine.advance(2.0)
    assert engine.engine.calls == [("reset",)]


def test_a_fault_that_is_over_is_forgotten():
    engine, fault = FaultyEngine(Driven(Plant(bridged()))), parse("wheel_blocked:lasts=0.1")

    def switch(plant, on, wheel):
        return None

    engine.add(fault._replace(kind=fault.kind._replace(switch=switch)))
    kept = weakref.ref(switch)
    del switch
    engine.advance(0.05)
    assert kept() is not None
    engine.advance(0.2)
    assert kept() is None


def test_a_fault_of_the_line_that_is_over_is_forgotten():
    engine, made = FaultyEngine(Echo()), []
    fault = parse("loss:lasts=0.1")

    def make(*args, **values):
        made.append(weakref.ref(found := fault.kind.make(*args, **values)))
        return found

    engine.add(fault._replace(kind=fault.kind._replace(make=make)))
    engine.advance(0.05)
    assert [each() is None for each in made] == [False, False]
    engine.advance(0.2)
    assert [each() is None for each in made] == [True, True]


@pytest.mark.parametrize(
    "spec, text",
    [
        ("nope", "fault 'nope' is unknown, expected loss, change"),
        ("loss:rate=2", "rate is '2', expected 0 to 1"),
        ("loss:rate=nan", "rate is 'nan', expected 0 to 1"),
        ("loss:burst=1.5", "burst is '1.5', expected a whole number, 1 to 1024 byte"),
        ("flip:direction=up", "direction is 'up', expected both, to_board or to_host"),
        ("wheel_blocked:wheel=rear", "wheel is 'rear', expected left, right, rear_left or rear_right"),
        ("reset:lasts=0", "lasts is '0', expected 0.001 to 1e+09 s"),
    ],
)
def test_a_wrong_spelling_says_key_value_and_range(spec, text):
    with pytest.raises(ConfigError) as error:
        parse(spec)
    assert text in str(error.value)


def echoed(*faults):
    """What comes back, 5 ms by 5 ms, of a frame each 10 ms for 20 s, and what is done to the engine."""
    engine, out = FaultyEngine(Echo(), faults), []
    for ms in range(0, 20000, 5):
        if ms % 10 == 0:
            engine.receive(b"@11,300,0e")
        out.append(engine.advance((ms + 5) / 1000))
    return out, engine.engine.calls


@pytest.fixture(scope="module")
def echoed_well():
    return echoed()


@pytest.mark.parametrize("name", [name for name, kind in FAULTS.items() if not kind.switch])
def test_every_fault_of_link_and_board_has_an_effect_with_its_defaults(name, echoed_well):
    assert echoed(name) != echoed_well


def test_the_default_text_holds_no_frame():
    text = dict((p.name, p.default) for p in FAULTS["text"].parameters)["text"].encode() + b"\r\n"
    for direction in (REPLIES, REQUESTS):
        events = FrameDecoder(direction, checked=True).feed(text)
        assert {event.code for event in events if isinstance(event, Frame)} <= {STOP_CODE}


@given(
    st.floats(0, 50),
    st.floats(0.01, 5),
    st.one_of(st.just(0.0), st.floats(0.01, 20)),
    st.lists(st.floats(0, 100), max_size=30),
)
def test_a_window_is_switched_only_when_it_says(at, lasts, every, times):
    window = Window(at, lasts, every)
    now = 0.0
    for time_s in sorted(times):
        if time_s < window.next_s(now):
            state = window.on(now)
            assert window.on(time_s) == state
        now = time_s


class Driven:
    """An engine that drives both wheels forward at full duty, and collects the edges."""

    next_event_s = math.inf

    def __init__(self, plant):
        self.plant, self.edges, self.causes = plant, [], []
        for motor in (0, 1):
            plant.bridge.write(0.0, motor, 1.0, 1.0, 0.0)

    def advance(self, to_s):
        self.plant.advance(to_s)
        self.edges += self.plant.bridge.take_edges()
        return b""

    def receive(self, data):
        pass

    def reset(self):
        self.causes.append("external")

    def brown_out(self):
        self.causes.append("brown_out")


def driven(*faults):
    return FaultyEngine(Driven(Plant(bridged())), faults)


def test_a_blocked_wheel_stands_until_it_is_free():
    engine = driven("wheel_blocked:wheel=right,at=0.3,lasts=0.3")
    wheel = engine.engine.plant.bridge.motor(1)
    speeds = []
    for to_s in (0.29, 0.59, 0.9):
        engine.advance(to_s)
        speeds.append(wheel.speed > 0.0)
    assert speeds == [True, False, True]


@pytest.mark.parametrize(
    ("lasting", "short", "part"),
    [
        ("wheel_blocked", "wheel_blocked", lambda plant: plant.robot.motors[0].blocked),
        ("battery_sag:volts=3", "battery_sag:volts=1", lambda plant: plant.robot.sag_v),
        ("encoder_open", "encoder_swapped", lambda plant: plant.robot.motors[0].sensed),
        ("encoder_open:channel=a", "encoder_open:channel=b", lambda plant: plant.robot.motors[0].sensed),
        ("sonar_failed:state=dead", "sonar_failed:state=stuck", lambda plant: plant.sonars.failed),
    ],
)
def test_a_fault_outlasts_another_one_of_the_same_part(lasting, short, part):
    _, faulty = ahead(lasting)
    engine, plant = ahead(lasting)
    engine.inject(short + ("," if ":" in short else ":") + "lasts=1")
    engine.advance(2.0)
    assert part(plant) == part(faulty)


def test_a_brown_out_is_a_reset_with_its_own_cause():
    engine = driven("brown_out:at=0.5", "reset:at=0.7")
    engine.advance(1.0)
    assert engine.engine.causes == ["brown_out", "external"]


def ahead(*faults):
    """A TraxBot whose motor board has driven it forward for a second, with faults from the start."""
    plant = Plant(model("traxbot"))
    plant.sonars.power(True, 0.0)
    plant.sonars.hold(True, 0.0)

    engine = FaultyEngine(
        SimpleNamespace(plant=plant, advance=lambda to_s: plant.advance(to_s) or b""), faults
    )
    plant.motor_board.move_differential(0.0, 200, 0)
    plant.advance(1.0)
    return engine, plant


@pytest.mark.parametrize(
    ("fault", "counts", "turns"),
    [
        ("encoder_open", "none", -1),
        ("encoder_swapped", "back", -1),
        ("motor_reversed", "back", 1),
        ("wheel_blocked", "none", 1),
        ("wheel_slips:grip=0", "ahead", 1),
    ],
)
def test_a_faulty_left_wheel_counts_and_moves_as_it_does_on_the_floor(fault, counts, turns):
    """Speed control follows the encoder: without one, or with a reversed one, the wheel runs away."""
    _, plant = ahead(fault)
    left, _, right = plant.motor_board.counts()
    assert {-1: "back", 0: "none", 1: "ahead"}[(left > 5) - (left < -5)] == counts
    assert right > 100
    assert plant.robot.state.yaw_rad * turns > 0.1


def test_clear_mends_motor_board_wheels_and_sonars():
    engine, plant = ahead(
        *(
            "encoder_open",
            "wheel_blocked",
            "wheel_slips",
            "motor_reversed",
            "motor_board_absent",
            "sonar_failed",
        )
    )
    motor = plant.robot.motors[0]
    broken = motor.sensed, motor.blocked, motor.polarity, plant.robot.grip[0], plant.motor_board.present
    assert broken == (0.0, True, -1.0, 0.5, False)
    engine.clear()
    mended = motor.sensed, motor.blocked, motor.polarity, plant.robot.grip[0], plant.motor_board.present
    assert mended == (1.0, False, 1.0, 1.0, True)
    assert plant.sonars.failed == {}


@pytest.mark.parametrize(("state", "shows"), [("dead", (0, 0)), ("stuck", (0, 0)), ("deaf", (645, 645))])
def test_a_failed_sonar_shows_no_reading_the_same_one_or_nothing_in_range(state, shows):
    engine, plant = ahead(f"sonar_failed:sonar=left,state={state}")
    counts = [
        [round(plant.adc_volts(channel, s) * 1024 / 5 - 0.5) for channel in range(3)] for s in (1.5, 3.0)
    ]
    assert tuple(max(0, at[1]) for at in counts) == shows
    assert counts[0][0] > counts[1][0] > 10 and counts[0][2] > 10


def measuring(*faults):
    """A Python board with an IMU whose stream has run for half a second, and what it has sent."""
    board = FaultyEngine(PythonBoard(Plant(model("traxbot"), imu=True)), faults)
    board.advance(0.2)
    board.receive(b"@47,20e")
    return board, board.advance(0.5)


@pytest.mark.parametrize("fault", ["imu_absent", "imu_power"])
def test_an_imu_that_is_gone_comes_back(fault):
    """0.5 s until the board looks for it, and 0.06 s until it has settled."""
    board, before = measuring(f"{fault}:at=0.5,lasts=0.3")
    gone, after = board.advance(0.8), board.advance(1.3)
    assert before and after
    assert gone == b""


def test_a_frozen_imu_repeats_its_reading():
    board, _ = measuring("imu_frozen:at=0.5")
    frames = board.advance(1.0).split(b"\r\n")[1:-1]
    assert len(frames) > 10
    assert len(set(frames)) == 1


@pytest.mark.parametrize(
    ("fault", "active", "latched"),
    [
        ("input_stuck:input=bumper_left", 1, 0),
        ("input_open", 32, 1),
        ("input_open:input=bumper_left", 0, 0),
        ("input_open:input=cliff_left", 8, 0),
    ],
)
def test_a_faulty_input_is_what_its_line_reads(fault, active, latched):
    board = FaultyEngine(PythonBoard(Plant(bridged(**WITH_INPUTS))), [fault])
    board.advance(0.1)
    board.receive(encode_request(READ_INPUTS))
    assert board.advance(0.2) == encode_reply(READ_INPUTS, active, latched, 63)


def traxbot():
    return Plant(model("traxbot"))


def needing(what):
    return [name for name, kind in FAULTS.items() if kind.needs == what]


@pytest.mark.parametrize(
    ("plant", "name", "text"),
    [
        *((traxbot, name, "needs motors on an H-bridge, robot traxbot") for name in needing("bridge")),
        *((traxbot, name, "needs an IMU, robot traxbot has none") for name in needing("imu")),
        *((lambda: Plant(model("duo")), name, "needs inputs that stop it") for name in needing("inputs")),
        (traxbot, "radio_cut", "needs a radio, robot traxbot has none; expected --radio too"),
        (lambda: Plant(model("traxbot"), sonars=False), "sonar_failed", "needs MB1300 sonars"),
        (
            lambda: Plant(bridged()._replace(sonars={})),
            "sonar_failed",
            "needs MB1300 sonars, robot duo has none",
        ),
        (lambda: Plant(model("pioneer")), "wheel_slips", "needs motors, robot pioneer has none"),
        (lambda: Plant(bridged()), "motor_reversed", "needs an OMNI-3MD, robot duo has"),
    ],
)
def test_a_robot_without_the_part_has_no_such_fault(plant, name, text):
    with pytest.raises(ConfigError, match=f"fault '{name}' {text}"):
        FaultyEngine(SimpleNamespace(plant=plant()), [name])


@pytest.mark.parametrize(
    ("board", "fault", "text"),
    [
        ({}, "wheel_blocked:wheel=rear_left", "wheel rear_left, robot duo has left, right"),
        (
            {"pin_range_1_trigger": 12, "pin_range_1_echo": 17},
            "range_failed:input=range_5",
            "input range_5, robot duo has range_1",
        ),
        ({"pin_bumper_left": 17}, "input_open", "input emergency_stop, robot duo has bumper_left"),
    ],
)
def test_a_fault_of_a_place_that_the_robot_lacks_says_which_it_has(board, fault, text):
    with pytest.raises(ConfigError, match=f"is of {text}$"):
        FaultyEngine(SimpleNamespace(plant=Plant(bridged(**board))), [fault])


def test_a_fault_of_a_sonar_that_the_robot_lacks_says_which_it_has():
    base = model("traxbot")
    plant = Plant(base._replace(sonars={"front": base.sonars["front"]}))
    with pytest.raises(ConfigError, match="is of sonar left, robot traxbot has front$"):
        FaultyEngine(SimpleNamespace(plant=plant), ["sonar_failed:sonar=left"])


def test_a_rear_wheel_is_one_of_four():
    plant = Plant(four_wheels("skid"))
    FaultyEngine(SimpleNamespace(plant=plant, now_s=0.0), ["wheel_blocked:wheel=rear_left"])
    assert plant.bridge.motor(2).blocked
