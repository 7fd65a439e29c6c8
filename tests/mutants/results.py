"""Results of mutants, kept in build/mutants/ for each source; equivalents; the table."""

import hashlib
import json
import pathlib
from typing import Any, Dict, Iterable, List, NamedTuple, Optional

import yaml

HERE = pathlib.Path(__file__).parent
FOLDER = pathlib.Path("build/mutants")
KILLED = ("killed", "timeout", "crash")
"""States in which the tests have noticed the mutant."""
GOAL, SAFETY_GOAL, MOST_EQUIVALENT = 0.90, 0.95, 0.05

Result = Dict[str, Any]
Equivalents = Dict[str, Dict[str, str]]


class Score(NamedTuple):
    """Numbers of mutants of one source."""

    killed: int
    all: int
    equivalent: int
    """Survivors that change nothing that can be seen, each with a reason in equivalents.yaml."""

    @property
    def share(self) -> float:
        """Share of the mutants that tests can notice which they do notice."""
        counted = self.all - self.equivalent
        return self.killed / counted if counted else 1.0


def hash_of(files: Iterable[str]) -> str:
    """Return a hash of the contents of these files."""
    total = hashlib.sha256()
    for file in sorted(files):
        total.update(pathlib.Path(file).read_bytes())
    return total.hexdigest()[:16]


def path_of(source: str) -> pathlib.Path:
    """Return the file with the results of a source."""
    return FOLDER / f"{source.replace('/', '_')}.json"


def load(source: str) -> Optional[Result]:
    """Return the results of a source; None if there are none."""
    path = path_of(source)
    return json.loads(path.read_text()) if path.exists() else None


def save(result: Result) -> None:
    """Keep the results of a source; a reader sees the old file or the new one."""
    path = path_of(result["file"])
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps(result, indent=1))
    new.replace(path)


def equivalents() -> Equivalents:
    """Return the reasons of equivalent mutants by source and key."""
    return yaml.safe_load((HERE / "equivalents.yaml").read_text()) or {}


def score(result: Result, listed: Equivalents) -> Score:
    """Count the mutants of a source."""
    own = listed.get(result["file"], {})
    killed = sum(each["state"] in KILLED for each in result["mutants"])
    return Score(killed, len(result["mutants"]), sum(each["key"] in own for each in survivors(result)))


def survivors(result: Result) -> List[Dict[str, Any]]:
    """Return the mutants that no test has noticed."""
    return [each for each in result["mutants"] if each["state"] not in KILLED]


def errors(result: Result, safety: bool, listed: Equivalents) -> List[str]:
    """Return what is wrong with a source: its score, or its list of equivalents."""
    own, name = listed.get(result["file"], {}), result["file"]
    left = {each["key"] for each in survivors(result)}
    found = [f"{name}: listed as equivalent, but killed or gone: {key}" for key in own if key not in left]
    counts, goal = score(result, listed), SAFETY_GOAL if safety else GOAL
    if result.get("left"):
        found.append(f"{name}: the run was broken off, {result['left']} mutants are left; run it again")
    if counts.share < goal:
        found.append(f"{name}: {counts.share:.1%} killed, expected at least {goal:.0%}; see --survivors")
    if counts.equivalent > MOST_EQUIVALENT * counts.all:
        found.append(
            f"{name}: {counts.equivalent} of {counts.all} listed as equivalent, expected at most 5 %"
        )
    return found


def row(result: Result, safety: bool, listed: Equivalents) -> str:
    """Return the row of a source in the table."""
    counts = score(result, listed)
    goal = SAFETY_GOAL if safety else GOAL
    return (
        f"| `{result['file']}` | {counts.all} | {counts.killed} | {counts.equivalent} | "
        f"{counts.share:.1%} | {goal:.0%} |"
    )


HEAD = "| source | mutants | killed | equivalent | score | goal |\n|---|---|---|---|---|---|"
