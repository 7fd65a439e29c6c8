"""Everything that reads gives a valid result or an error in one line; `make fuzz` tries a million times more inputs."""

import multiprocessing
import os
import random

import pytest

from mrl_driver import figures
from mrl_driver.errors import MrlError
from sim_arduino.replay.replay import show
from tests.long.fuzz.inputs import limit_memory, run
from tests.long.fuzz.judge import CORPORA, corpus, judge
from tests.long.fuzz.mutation import mutate
from tests.long.fuzz.readers import BY_INPUT, FILES, HOSTILE, INPUTS

REFUSED_S = 10.0  # Longest CPU time for an input of `HOSTILE` [s]
CHANGED = 40  # Changed inputs of a plain file; of a dear reader fewer
LONG = {"sonar_points": b'1,"' + b"9" * 140_000}
"""Inputs too long for the corpus: fields that the csv module refuses."""


@pytest.mark.parametrize("input_", INPUTS, ids=lambda each: each.name)
def test_what_is_read_gives_a_result_or_an_error_in_one_line(input_, tmp_path):
    """The kept inputs, among them all that once did harm, and some seeded changes of them."""
    kept, rng = corpus(input_), random.Random(input_.name)
    seeds = list(kept.values())
    for _ in range(max(2, CHANGED // input_.cost)):
        data = mutate(rng.choice(seeds), seeds, input_.tokens, rng)
        kept[f"changed {len(kept)}: {data[:200]!r}"] = data
    found = {name: judge(input_, data, tmp_path).problem for name, data in kept.items()}
    assert not {name: problem for name, problem in found.items() if problem}


def _judge_apart(input_, data, folder, verdicts):
    limit_memory()
    verdicts.put(judge(input_, data, folder, REFUSED_S).problem)


@pytest.mark.parametrize(
    ("name", "make"), [pytest.param(name, make, id=f"{name}: {what}") for name, what, make in HOSTILE]
)
def test_a_file_of_strangers_takes_neither_memory_nor_time(name, make, tmp_path):
    context = multiprocessing.get_context("fork")
    verdicts = context.SimpleQueue()
    process = context.Process(target=_judge_apart, args=(BY_INPUT[name], make(), tmp_path, verdicts))
    process.start()
    process.join()
    assert not process.exitcode and verdicts.get() == ""


@pytest.mark.parametrize("name", FILES)
def test_a_pipe_is_refused_and_not_waited_for(name, tmp_path):
    file, read = FILES[name]
    os.mkfifo(tmp_path / file)
    with pytest.raises(MrlError):
        read(str(tmp_path / file))


@pytest.mark.parametrize("name", LONG)
def test_a_field_without_end_is_an_error_in_one_line(name, tmp_path):
    verdict = judge(BY_INPUT[name], LONG[name], tmp_path)
    assert not verdict.problem and "field larger than field limit" in verdict.shape


def test_each_reader_has_a_corpus_and_each_corpus_a_reader():
    assert {path.name for path in CORPORA.iterdir()} == set(BY_INPUT)
    assert all(map(corpus, INPUTS))


def test_texts_of_a_recording_give_no_orders_to_a_terminal(capsys):
    show({"port": "a\x1b[2J\nb", "robot": None, "skipped": {}}, as_json=False)
    assert capsys.readouterr().out.split() == ["port", "a\\x1b[2J\\nb", "robot", "unknown"]


def test_texts_of_files_are_no_formulas_in_a_figure(tmp_path):
    """Two `$` with half a formula in between ended `mrl plot` with a traceback."""
    drawn = figures.figure(2, 1)
    drawn.suptitle(figures.plain("$x_{$ \n drive.mrl"))
    figures.save(drawn, str(tmp_path / "drive.png"))
    assert figures.plain("a$b\n") == r"a\$b\n"


def test_an_error_has_one_line_whatever_it_quotes():
    """Names and keys of strangers' files stand in errors, and a terminal obeys some of them."""
    assert str(MrlError("key a\nb\x1b[2J\x9b\u202e is ä")) == "key a\\nb\\x1b[2J\\x9b\\u202e is ä"


def test_an_error_has_its_beginning_and_its_end_however_long_what_it_quotes_is():
    words = str(MrlError("file.yaml: key " + "k" * 5000 + " is unknown, expected walls"))
    assert len(words) == 1000 and words.startswith("file.yaml: key k") and words.endswith(", expected walls")


def hang(data, folder):
    while data:
        pass


def test_a_reader_that_hangs_or_needs_too_much_memory_is_found(monkeypatch, tmp_path):
    from tests.long.fuzz import inputs

    monkeypatch.setattr(inputs, "BUILD", tmp_path)
    monkeypatch.setattr(inputs, "HUNG_S", 0.1)
    seeds = "port_address"
    monkeypatch.setitem(BY_INPUT, seeds, BY_INPUT[seeds]._replace(read=hang))
    greedy = BY_INPUT["errors"]._replace(read=lambda data, folder: bytearray(2 << 30))
    monkeypatch.setitem(BY_INPUT, "errors", greedy)
    found = {each.name: list(each.problems.values()) for each in run([seeds, "errors"], 0.2, 1, 2)}
    assert found[seeds] == ["hangs"]
    assert found["errors"][0].startswith("MemoryError")
