#!/usr/bin/env bash
# Runs the tests that need no ROS on every Python from 3.8 to 3.13 that is found on PATH or below ~/.pyenv: on 3.8 with the
# oldest dependencies that setup.py allows, on the others with the newest.  PYTHONS="3.8 3.12" chooses.
set -uo pipefail
cd "$(dirname "$0")/.."

NEED_ROS="tests/ros tests/documents/test_robot_recipe.py"
FOLDER=build/pythons
mkdir -p $FOLDER

found() { # VERSION
  local python
  for python in "$HOME"/.pyenv/versions/"$1".*/bin/python"$1" "python$1"; do
    "$python" -c "import venv" 2>/dev/null && echo "$python" && return
  done
}

tested() { # PYTHON VENV VERSION
  [ -x "$2/bin/python" ] || "$1" -m venv "$2" || return
  local constraints=$2/constraints.txt
  : >"$constraints"
  [ "$3" != 3.8 ] || sed -n '/install_requires/,/\]/s/.*"\(.*\)>=\(.*\)".*/\1==\2/p; s/.*"\(matplotlib\)>=\(.*\)",$/\1==\2/p' setup.py >"$constraints"
  # The resolver of 3.8's own pip does not come to an end with the packages of the tests.
  "$2/bin/python" -m pip install -q --disable-pip-version-check -U pip || return
  "$2/bin/python" -m pip install -q --disable-pip-version-check -c "$constraints" -e '.[dev]' || return
  "$2/bin/python" -m pip freeze -q | grep -iE '^(pyserial|numpy|pyyaml|click|rich)==' | tr '\n' ' '
  # shellcheck disable=SC2086
  PATH="$PWD/$2/bin:$PATH" "$2/bin/python" -m pytest -n "${WORKERS:-$(nproc)}" --dist loadfile -m "not realtime" tests $(printf -- '--ignore=%s ' $NEED_ROS)
}

failed=0 count=0
for version in ${PYTHONS:-3.8 3.9 3.10 3.11 3.12 3.13}; do
  python=$(found "$version")
  [ -n "$python" ] || { echo "Python $version: not found"; continue; }
  count=$((count + 1)) start=$SECONDS
  if tested "$python" "$FOLDER/$version" "$version" >"$FOLDER/$version.log" 2>&1; then
    result=passed
  else
    result="failed: $FOLDER/$version.log" failed=1
  fi
  printf 'Python %-5s %4d s  %s\n' "$version" $((SECONDS - start)) "$result"
  grep -E '^(FAILED|ERROR|SKIPPED)|==|[0-9]+ passed' "$FOLDER/$version.log" | tail -n 12 | sed 's/^/    /'
done
[ $count != 0 ] || { echo "no Python from 3.8 to 3.13 was found" >&2; exit 1; }
exit $failed
