"""Environment sensors and sonars: readings, curves, absence, streams and timing."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.protocol.table import FAULTS, TICK_S
from mrl_driver.robot import models
from sim_arduino.hardware.wiring import Plant
from tests.firmware.pc_board import ENVIRONMENT, SONARS, load
from tests.models import model

SENSOR = 1 << [name for name, _ in FAULTS].index("sensor")
FAN, HEATER, SONAR_TRIGGER, SONAR_POWER = 7, 15, 12, 13
THERMOPILE, COMPASS = 0x68, 0x60
LITRES = 0.2832  # 0.01 cubic feet, the unit of the dust sensor's data sheet [l]


def pieces_per_litre(percent):
    """The PPD42NS's characteristic over its low-pulse occupancy [%]."""
    return (1.1 * percent**3 - 3.8 * percent**2 + 520 * percent) / LITRES


class Wired(Plant):
    def __init__(self):
        super().__init__(model("traxbot"), sonars=False)
        self.pins = []

    def pin_changed(self, pin, level, time_s):
        self.pins.append((pin, level))


@pytest.fixture
def board(bench):
    made = bench(plant=Wired(), library=ENVIRONMENT)
    made.run(0.2)
    return made


@pytest.fixture(scope="module")
def native():
    return load(ENVIRONMENT)


def test_counts_in_the_sensor_stream_are_fresh(board):
    """Read within 2 ms before the frame's first byte, whatever the thermopile takes."""
    board.send("start_sensor_stream", 50, wait_s=0.3)
    reads = board.write_times(0xD8)
    assert len(reads) == pytest.approx(len(board.frames()), abs=1)


@pytest.mark.parametrize("name", ["start_sensor_stream", "start_sensor_ldr_stream", "start_compass_stream"])
def test_sensor_streams_end(board, name):
    board.send(name, wait_s=0.2)
    board.send(name.replace("start", "stop"), wait_s=0.05)
    board.forget()
    board.run(0.2)
    assert not board.heard


@pytest.mark.parametrize(
    "address, name",
    [(THERMOPILE, "start_sensor_stream"), (THERMOPILE, "read_thermopile"), (COMPASS, "start_compass_stream")],
)
def test_missing_sensor_is_flagged_and_sends_nothing(board, address, name):
    board.plant.i2c[address].present = False
    board.send(name, wait_s=0.3)
    assert not board.frames() and board.faults() & SENSOR
    assert board.ask("read_encoders").args == (0, 0)


def test_sensor_that_comes_is_used_until_it_vanishes(board):
    board.plant.i2c[COMPASS].present = False
    board.send("start_compass_stream", 20, wait_s=0.3)
    board.plant.i2c[COMPASS].present = True
    board.run(0.3)
    board.faults()
    assert board.frames() and not board.faults() & SENSOR
    board.plant.i2c[COMPASS].present = False
    board.run(0.6)
    board.forget()
    board.run(0.3)
    assert not board.frames()


@pytest.mark.parametrize("tenths, valid", [(3599, True), (3600, False), (0xFFFF, False)])
def test_nonsense_of_a_sensor_is_no_reading(board, tenths, valid):
    """A compass that answers a full circle or more, between two good readings."""
    board.send("start_compass_stream", 20, wait_s=0.3)
    compass = board.plant.i2c[COMPASS]
    compass.read = lambda count, time_s: tenths.to_bytes(count, "big")
    board.run(0.1)
    sent = (tenths // 10,) in {frame.args for frame in board.frames()}
    assert sent == valid and bool(board.faults() & SENSOR) != valid
    del compass.read
    board.forget()
    board.run(0.2)
    assert {frame.args for frame in board.frames()} - {(359,)} == {(90,)}


def test_motor_board_is_still_driven_while_sensors_are_read(board):
    """At 100 kHz a thermopile takes 1.1 ms of the bus."""
    board.send("start_sensor_stream")
    board.forget()
    for speed in range(100, 150):
        board.raw(b"@11,%d,0e" % speed, wait_s=0.005)
    assert [data[1:3] for data in board.writes(0xEB)] == [n.to_bytes(2, "big") for n in range(100, 150)]


def test_heater_and_fan_are_on(board):
    assert board.plant.pins == [(HEATER, 0), (FAN, 1)]


@settings(deadline=None)
@given(st.floats(0.0, 20.0))
def test_dust_characteristic(native, percent):
    """Within 1 % and 40 pieces, up to 40000 a litre: more reads 32767."""
    total = int(30 / TICK_S)
    wanted = min(32767, pieces_per_litre(percent))
    assert native.pc_dust_per_litre(int(total * percent / 100), total) == pytest.approx(
        wanted, rel=0.01, abs=40
    )


@pytest.mark.parametrize(
    "low, total, count", [(0, 0, 0), (0, 1000, 0), (1000, 1000, 32767), (5000, 1000, 32767)]
)
def test_dust_extremes(native, low, total, count):
    assert native.pc_dust_per_litre(low, total) == count


def dusty(board, seconds, percent):
    """Low pulses that make up a share of the time."""
    for _ in range(int(seconds / 0.1)):
        board.board.native.pc_dust(int(0.1 / TICK_S * percent / 100))
        board.run(0.1)


@pytest.mark.parametrize("seconds, error", [(30.0, 0.03), (6.0, 0.1)])
def test_dust_is_counted_over_half_a_minute_or_since_the_start(board, seconds, error):
    dusty(board, seconds, percent=2.0)
    assert board.ask("read_dust").args[0] == pytest.approx(pieces_per_litre(2.0), rel=error)


def test_old_dust_is_forgotten(board):
    dusty(board, 10.0, percent=5.0)
    board.run(31.0)
    assert board.ask("read_dust").args == (0,)


def test_a_silent_dust_sensor_is_flagged_until_it_comes_back(board):
    """Although the other sensors answer."""
    board.send("start_sensor_stream", 50)
    board.run(55.0)
    before = board.faults()
    board.run(15.0)
    assert (before, board.faults() & SENSOR) == (0, SENSOR)
    dusty(board, 6.0, percent=1.0)
    board.faults()
    assert board.faults() == 0


POWER, TRIGGER = 13, 12
FRONT, LEFT, RIGHT = range(3)


@pytest.fixture(scope="module")
def sonars():
    return load(SONARS)


def formula(count, a, b, c):
    return max(0, min(1250, round(a * 1e-4 * count ** (b * 1e-4) + c * 1e-4)))


def test_thesis_curve_for_all_counts(sonars):
    """Within 1 cm of 1.1767 s^0.9466 - 0.3759; nearly all exact."""
    errors = [
        abs(sonars.pc_power_law(s, 11767, 9466, -3759) - formula(s, 11767, 9466, -3759))
        for s in range(1, 1024)
    ]
    assert max(errors) <= 1 and sum(errors) < 50


@settings(deadline=None)
@given(st.integers(10, 700), st.integers(1, 32767), st.integers(1, 20000), st.integers(-32768, 32767))
def test_any_curve(sonars, count, a, b, c):
    assert abs(sonars.pc_power_law(count, a, b, c) - formula(count, a, b, c)) <= 1


class WiredSonars(Plant):
    """Sonar outputs with voltages of the test's; remembers pin changes."""

    def __init__(self, counts):
        super().__init__(models.load("traxbot"))
        self.counts, self.pins, self.reads = counts, [], []

    def adc_volts(self, channel, time_s):
        self.reads.append((channel, time_s))
        return (self.counts[channel] + 0.5) * 5 / 1024

    def pin_changed(self, pin, level, time_s):
        self.pins.append((pin, level, time_s))


@pytest.mark.parametrize(
    "count, wire",
    [(0, -1), (9, -1), (10, 10), (307, 266), (639, 532), (640, 645), (700, 645), (701, -1), (1023, -1)],
)
def test_thresholds(bench, count, wire):
    """Missing and saturated sensors have no reading; the end of the range is "nothing"."""
    board = bench(plant=WiredSonars([count, 100, 100]))
    board.run(1.0)
    assert board.ask("read_sonars").args[FRONT] == wire


def test_not_ready_at_first(bench):
    """250 ms of power, then 100 ms for each sensor in its turn."""
    board = bench(plant=WiredSonars([100, 200, 300]), boot=False)
    board.run(0.34)
    first = board.ask("read_sonars").args
    board.run(0.05)
    second = board.ask("read_sonars").args
    board.run(0.25)
    assert first == (-1, -1, -1) and second[1:] == (-1, -1) and -1 not in board.ask("read_sonars").args


def test_trigger_is_a_pulse(bench):
    """20 us at least, and over before the chain's end."""
    plant = WiredSonars([100] * 3)
    board = bench(plant=plant)
    board.run(1.0)
    up, down = ([t for pin, level, t in plant.pins[2:] if (pin, level) == (TRIGGER, v)] for v in (1, 0))
    assert 20e-6 <= down[0] - up[0] < 0.02


def test_chain_starts_again_after_three_readings(bench):
    plant = WiredSonars([100] * 3)
    board = bench(plant=plant)
    board.run(3.0)
    times = [t for pin, level, t in plant.pins if (pin, level) == (TRIGGER, 1)]
    gaps = [later - earlier for earlier, later in zip(times, times[1:])]
    assert 0.3 <= min(gaps) and max(gaps) < 0.33


def test_a_reading_is_never_older_than_one_cycle(bench):
    plant = WiredSonars([100, 100, 100])
    board = bench(plant=plant)
    board.run(1.0)
    plant.counts = [0, 1023, 0]
    board.run(0.35)
    assert board.ask("read_sonars").args == (-1, -1, -1)
