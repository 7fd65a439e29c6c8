"""The slices in which a simulated chip and the motors on its bridges run."""

import pytest

from sim_arduino.board.bridge_wires import BridgeWires
from sim_arduino.hardware.wiring import Plant
from tests.models import bridged

MHZ = 16000000
MS = 16000


class Chip:
    """A chip whose outputs are high for fixed shares of time; notes what is planned at its inputs."""

    frequency_hz = MHZ
    overshoot = 3

    def __init__(self):
        self.cycle, self.duties, self.levels, self.edges = 0, {}, {}, []
        self.high = dict.fromkeys((5, 6, 7, 11, 3, 9), 0.0)

    def run_until(self, cycle):
        """Like the real one, it stops some cycles late."""
        self.passed(cycle + self.overshoot - self.cycle)

    def passed(self, cycles):
        self.cycle += cycles
        for pin, duty in self.duties.items():
            self.high[pin] += duty * cycles

    def high_cycles(self, pin):
        return self.high[pin]

    def set_pin(self, pin, level):
        self.levels[pin] = level

    def plan_edges(self, pin, cycles):
        self.edges += [(cycle, pin, self.cycle) for cycle in cycles]


@pytest.fixture
def rig():
    plant = Plant(bridged())
    chip = Chip()
    return chip, plant, BridgeWires(chip, plant.bridge)


def full(chip):
    """Left and right forward at full duty (TB6612)."""
    chip.duties = {5: 1.0, 6: 1.0, 7: 0.0, 11: 1.0, 3: 1.0, 9: 0.0}


def test_the_chip_sees_the_encoders_levels_from_the_start(rig):
    chip, plant, _ = rig
    assert chip.levels == plant.bridge.levels


def test_the_motors_get_the_shares_of_the_slice_before(rig):
    """Outputs that rise in the first slice drive the motors from its end on."""
    chip, plant, wires = rig
    full(chip)
    wires.run(MS, chip.run_until)
    assert [plant.bridge.motor(wheel).shares.forward for wheel in (0, 1)] == [1.0, 1.0]
    wires.run(2 * MS, chip.run_until)
    assert plant.bridge.motor(0).speed > 0.0


def test_a_duty_is_the_mean_of_the_slice(rig):
    chip, plant, wires = rig
    full(chip)
    chip.duties[5] = 0.25
    wires.run(MS, chip.run_until)
    assert plant.bridge.motor(0).shares.forward == pytest.approx(0.25)
    assert plant.bridge.motor(1).shares.forward == 1.0


def test_edges_are_planned_ahead_of_the_chip_and_none_is_missing(rig):
    """At most one slice ahead, in order for each pin, as many as the wheels turned."""
    chip, plant, wires = rig
    full(chip)
    wires.run(500 * MS, chip.run_until)
    assert all(now <= cycle <= now + MS for cycle, _, now in chip.edges)
    for pin in (2, 4, 8, 10):
        cycles = [cycle for cycle, its, _ in chip.edges if its == pin]
        assert cycles == sorted(cycles)
    turned = plant.bridge.motor(0).travel + plant.bridge.motor(1).travel
    assert len(chip.edges) == pytest.approx(turned, abs=2) and turned > 100


def test_no_edge_is_planned_in_the_past(rig):
    """A wire that breaks jumps at the end of a slice, which the chip has passed by some cycles."""
    chip, plant, wires = rig
    wires.run(MS, chip.run_until)
    plant.bridge.encoder(0).open(0, True)
    wires.run(2 * MS, chip.run_until)
    assert chip.edges == [(2 * MS + chip.overshoot, 2, 2 * MS + chip.overshoot)]


def test_the_motors_are_at_most_one_slice_ahead(rig):
    chip, plant, wires = rig
    for cycle in (1, 100, MS - 10, MS, MS + 1, 5 * MS + 7):
        wires.run(cycle, chip.run_until)
        assert 0.0 <= plant.bridge.time_s - chip.cycle / MHZ <= 1e-3


def test_slices_do_not_depend_on_how_the_engine_is_called():
    ends = []
    for step in (MS // 3, 7 * MS, 250 * MS):
        plant, chip = Plant(bridged()), Chip()
        chip.overshoot = 0
        wires = BridgeWires(chip, plant.bridge)
        full(chip)
        for cycle in range(0, 250 * MS + 1, step):
            wires.run(cycle, chip.run_until)
        wires.run(250 * MS, chip.run_until)
        ends.append((plant.bridge.motor(0).travel, len(chip.edges)))
    assert ends[0] == ends[1] == ends[2]


def test_a_stalled_chip_goes_on_driving(rig):
    """Its timers run on, so its outputs keep their duties."""
    chip, plant, wires = rig
    full(chip)
    wires.run(200 * MS, lambda cycle: chip.passed(cycle - chip.cycle))
    assert plant.bridge.motor(0).speed > 1000.0


def test_wires_move_while_something_turns_or_is_driven(rig):
    chip, _, wires = rig
    wires.run(MS, chip.run_until)
    still = wires.moving
    full(chip)
    wires.run(5 * MS, chip.run_until)
    assert (still, wires.moving) == (False, True)
