"""What the long runs report, and a short form of the longest."""

import gc
import tracemalloc

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory

LEAK_BYTES = 25000  # More than what a few buffers may hold, less than 100 bytes a frame


def test_a_drive_at_100_hz_keeps_no_memory_and_loses_nothing():
    emulated = factory.make(factory.Options(robot="traxbot"))
    with SteppedDriver(emulated.engine, options=Options(period_ms=10)) as robot:
        robot.drive(0.1, 0.5)
        robot.wait(4.0)
        tracemalloc.start(1)
        robot.wait(1.0)
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        robot.wait(3.0)
        gc.collect()
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        counters = robot.link.statistics
        assert counters.frames > 750
        assert (
            counters.lost + counters.duplicates + counters.refused_counts + sum(counters.garbage.values())
            == 0
        )
    emulated.close()
    assert grown < LEAK_BYTES
