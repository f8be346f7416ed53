#!/usr/bin/env bash
# Tests, C++ and Python, in an environment of their own. Needs Python >= 3.11 and a C++20 compiler.
#   ./test.sh [--all] [pytest arguments]     --all: the slow tests as well
# VENV=folder, PYTHON=interpreter and WERROR=ON may be set. One build serves both languages.
set -euo pipefail
cd "$(dirname "$0")"
venv=${VENV:-.venv}
build=build/tests
lane=(-m "not slow")
if [ "${1:-}" = --all ]; then
  lane=()
  shift
fi

[ -x "$venv/bin/python" ] || "${PYTHON:-python3}" -m venv "$venv"
export PATH="$PWD/$venv/bin:$PATH"
python -m pip install --quiet --upgrade "pip>=25.1"
python -m pip install --quiet --group test
python -m pip install --quiet --no-build-isolation -C build-dir="$build" -C cmake.define.STIFFMAP_TESTS=ON \
  -C cmake.define.STIFFMAP_WERROR="${WERROR:-OFF}" .

ctest --test-dir "$build" --output-on-failure --parallel 2
python -m pytest -n auto --dist worksteal "${lane[@]}" "$@"
