"""What tests/conftest.py asks of tests."""

import pathlib

import pytest

from tests import tiers, waiting

pytest_plugins = ["pytester"]
HERE = pathlib.Path(__file__).parent
FLAKY = """
import pathlib, pytest

@pytest.mark.flaky(reruns=1, reason="the first try fails")
@pytest.mark.parametrize("name", range({tests}))
def test(name, request):
    tried = pathlib.Path(request.config.rootpath, f"tried{{name}}")
    if not tried.exists():
        tried.touch()
        pytest.fail("first try")
"""
REALTIME = """
import pytest

@pytest.mark.realtime
@pytest.mark.parametrize("number", range({tests}))
def test(number):
    pass
"""


@pytest.fixture
def run(pytester, monkeypatch):
    """Runs pytest on one file of tests below this project's conftest; exit code and output."""
    monkeypatch.setenv("PYTHONPATH", str(HERE.parent))
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    pytester.makeconftest((HERE / "conftest.py").read_text())
    pytester.makeini("[pytest]\ntimeout = 60")

    def start(code, *options):
        pytester.makepyfile(test_it=code)
        done = pytester.runpytest(*options)
        return done.ret, done.stdout.str() + done.stderr.str()

    return start


@pytest.mark.parametrize("tests, workers, passed", [(40, 0, True), (41, 1, False)])
def test_40_tests_may_be_realtime(run, tests, workers, passed):
    """A worker refuses them, too, which cannot end the run."""
    status, said = run(REALTIME.format(tests=tests), "-n", f"{workers}")
    assert (status == 0) == passed
    assert ("41 tests are marked realtime, expected at most 40" in said) == (not passed)


@pytest.mark.parametrize(
    "file, tier",
    [
        ("protocol/test_decoder.py", tiers.QUICK),
        ("ros/test_commander_guards.py", tiers.QUICK),
        ("driver/test_faults.py", tiers.TEST),
        ("documents/test_links.py", tiers.TEST),
        ("ros/test_robot_node.py", tiers.ALL),
        ("avr/test_engine.py", tiers.ALL),
        ("web/test_page_drives.py", tiers.ALL),
        ("packaging/test_packages.py", tiers.ALL),
    ],
)
def test_tier_of_a_file_is_that_of_what_it_imports(file, tier):
    assert tiers.of_file(HERE / file) == tier


def test_realtime_tests_may_be_left_out(run):
    code = REALTIME.format(tests=1) + "\n\ndef test_other():\n    pass\n"
    status, said = run(code, "-n", "0", "-m", "not realtime")
    assert status == 0 and "realtime: " not in said, said


def test_a_second_try_needs_a_reason_and_is_one(run):
    wrong = ("", '(reason="slow")', "(reruns=1)", '(reruns=2, reason="slow")')
    tests = [f"@pytest.mark.flaky{marker}\ndef test_{at}():\n    pass" for at, marker in enumerate(wrong)]
    _, said = run("\n".join(["import pytest", *tests]))
    assert said.count('expected flaky(reruns=1, reason="...")') >= 4 and "passed" not in said


@pytest.mark.parametrize("tests, workers, code", [(2, 0, 0), (3, 1, 1)])
def test_two_second_tries_are_allowed_and_counted(run, tests, workers, code):
    status, said = run(FLAKY.format(tests=tests), "-n", f"{workers}")
    assert status == code
    assert f"second tries: {tests} of at most 2" in said


def test_a_failing_test_runs_once(run, tmp_path):
    log = tmp_path / "log"
    status, _ = run(f"def test():\n    open({str(log)!r}, 'a').write('x')\n    assert False")
    assert (status, log.read_text()) == (1, "x")


def test_the_order_is_random_and_that_of_the_seed(run):
    code = "import pytest\n@pytest.mark.parametrize('n', range(9))\ndef test(n):\n    pass"

    def order(seed):
        said = run(code, "-v", "-p", "no:cacheprovider", f"--randomly-seed={seed}")[1]
        assert f"order: --randomly-seed={seed}" in said
        return [line.split()[0] for line in said.splitlines() if "PASSED" in line]

    first = order(1)
    assert len(first) == 9 and first == order(1) and first != order(2)


@pytest.mark.parametrize("patience, allowed_s", [(1.0, "7.0"), (3.0, "21.0")])
def test_patience_multiplies_the_time_out_of_a_test(run, monkeypatch, patience, allowed_s):
    monkeypatch.setattr(waiting, "PATIENCE", patience)
    code = "import pytest\n@pytest.mark.timeout(7.0)\ndef test(request):\n    raise SystemError(%s)"
    assert f"SystemError: {allowed_s}" in run(code % "request.node.get_closest_marker('timeout').args[0]")[1]
