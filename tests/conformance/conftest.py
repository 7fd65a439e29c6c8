"""Every test of this folder runs on every engine."""

import pytest

from .bench import ENGINES, Bench


@pytest.fixture(params=sorted(ENGINES))
def engine(request):
    return request.param


@pytest.fixture
def make(engine):
    """Makes benches that are closed at the end: `make(**options)` awake, `make(wake=False)` at power-on."""
    made = []

    def build(wake=True, **options):
        made.append(Bench(engine, **options))
        return made[-1].wake() if wake else made[-1]

    yield build
    for bench in made:
        bench.close()


@pytest.fixture
def bench(make):
    """A TraxBot's board, awake."""
    return make()


@pytest.fixture
def sensors(make):
    """A TraxBot's board of the environment-sensor build, awake."""
    return make(environment=True)
