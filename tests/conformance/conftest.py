"""Every test of this folder runs on every engine, and on both motor back ends unless its file or mark names one."""

import pytest

from .bench import ENGINES, ROBOTS, Bench


@pytest.fixture(params=sorted(ENGINES))
def engine(request):
    return request.param


@pytest.fixture(params=sorted(ROBOTS))
def motors(request):
    return request.param


@pytest.fixture
def benches(engine, close_later):
    """Makes benches that are closed at the end: `benches(motors, **options)` awake, with `wake=False` at power-on."""

    def build(motors, wake=True, **options):
        bench = close_later(Bench(engine, motors, **options))
        return bench.wake() if wake else bench

    return build


@pytest.fixture
def make(benches, motors):
    """Makes benches with the motor back end: `make(**options)`."""
    return lambda **options: benches(motors, **options)


@pytest.fixture
def bench(make):
    """The robot of the motor back end, awake: a TraxBot with an OMNI-3MD, or a duo with an H-bridge."""
    return make()


@pytest.fixture
def omni3md(benches):
    """A TraxBot's board with an OMNI-3MD, awake."""
    return benches("omni3md")


@pytest.fixture
def sensors(benches):
    """A TraxBot's board of the environment-sensor build, awake."""
    return benches("omni3md", environment=True)
