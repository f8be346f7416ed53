#!/usr/bin/env bash
# Tests, C++ and Python, in the environment of ./install.sh, with the versions of tests/versions.txt.
#   ./test.sh [--all] [pytest arguments]     --all: the slow tests as well
set -euo pipefail
cd "$(dirname "$0")"
lane=(-m "not slow")
if [ "${1:-}" = --all ]; then
  lane=()
  shift
fi

export PIP_CONSTRAINT=$PWD/tests/versions.txt
./install.sh -C cmake.define.STIFFMAP_TESTS=ON
export PATH="$PWD/${VENV:-.venv}/bin:$PATH"
python -m pip install --quiet --no-compile --group test
ctest --test-dir build/core --output-on-failure --parallel 2
export OPENBLAS_NUM_THREADS=1  # the workers share the processors: with threads of their own they take three times as long
export PYTHONDONTWRITEBYTECODE=  # a hundred tests start processes of their own: each would compile all modules anew
python -m pytest -n auto --dist worksteal "${lane[@]}" "$@"
