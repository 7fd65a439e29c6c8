"""`python -m tests.mutants.cpp [FILE ...]`: the C++ part alone."""

import argparse
import json
from pathlib import Path
from typing import Any, Dict, Optional

from tests.mutants import cpp


def _path(file: str) -> Any:
    return Path(given.folder) / (file.replace("/", "_") + ".json")


def _save(result: Dict[str, Any]) -> None:
    path = _path(result["file"])
    path.with_suffix(".new").write_text(json.dumps(result, indent=1))
    path.with_suffix(".new").replace(path)


def _load(file: str) -> Optional[Dict[str, Any]]:
    path = _path(file)
    return json.loads(path.read_text()) if path.exists() else None


parser = argparse.ArgumentParser()
parser.add_argument("files", nargs="*")
parser.add_argument("--most-tests", type=int)
parser.add_argument("--sample", type=int, default=0)
parser.add_argument("--folder", default="build/mutants")
given = parser.parse_args()
files = [cpp.FOLDER + name for name in given.files] or list(cpp.FILES)
cpp.run(files, _save, _load, given.most_tests, given.sample)
