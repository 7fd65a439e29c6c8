"""Every test of this folder runs on every engine, and on both motor back ends unless its file or mark names one.

The rows about motion and the board itself also run on the virtual robot of a bare board.
"""

import collections

import pytest

from tests.conftest import EXPLORE

from .bench import ENGINES, ROBOTS, Bench

ON_BARE_BOARDS = ("test_motion_rows", "test_service_rows", "test_vectors")
ON_BRIDGES = ("bridge", "input", "range", "servo", "wiring")
OF_ONE = {"test_omni3md_rows": "omni3md", **{f"test_{rows}_rows": "bridge" for rows in ON_BRIDGES}}
"""The motor back end of files about one of them."""
REPEATED = (
    "test_percent_of_full_speed_turns_each_wheel_at_its_share",
    "test_percent_of_full_duty_turns_each_wheel_its_way",
    "test_drives_at_the_speed_that_was_asked_for",
    "test_a_positional_move_ends_at_its_count",
    "test_a_stop_is_one_of_all_motors",
    "test_wires_that_the_board_knows_drive_the_right_wheels",
)
"""Of these the image runs one row with each motor back end: it is made of the PC build's sources, and the other rows
ask nothing more of the chip.  With a seed it runs all.
"""


def pytest_collection_modifyitems(items):
    """No board in Python calculates a robot, and the other files change what is around it."""
    left_out = {*filter(_left_out, items), *(() if EXPLORE else _repeats(items))}
    items[:] = [item for item in items if item not in left_out]


def _repeats(items):
    """All rows of `REPEATED` on the image but one of each test and motor back end."""
    rows = collections.defaultdict(list)
    for item in items:
        params = getattr(item, "callspec", None) and item.callspec.params
        if params and params.get("engine") == "avr" and item.originalname in REPEATED:
            rows[item.path, item.originalname, params.get("motors")].append(item)
    for each in rows.values():
        each.remove(min(each, key=lambda item: item.nodeid))
        yield from each


def _left_out(item):
    params = getattr(item, "callspec", None) and item.callspec.params
    if params and item.path.stem in OF_ONE:
        return params.get("motors", OF_ONE[item.path.stem]) != OF_ONE[item.path.stem]
    if not params or params.get("motors") != "virtual":
        return False
    return params.get("engine") == "python" or item.path.stem not in ON_BARE_BOARDS


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
