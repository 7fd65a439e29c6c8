"""How soon a hold by radio stops a robot: two images of the radio build, from host to motors."""

from tests.long.bench import bench_hold

LATEST_S = 0.06
"""`make bench-hold` has the figures; the text alone takes 23 ms on each of the two lines of the modules."""


def test_hold_stops_the_other_robot_in_time():
    times = bench_hold.measure(bench_hold.SILENCE, 2)
    assert len(times) == 2 and all(time_s is not None and time_s < LATEST_S for time_s in times)
