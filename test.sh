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
install="python -m pip install --quiet --no-compile"
$install --upgrade "pip>=25.1"
$install --group build

rm -f "$build"/wheel/*.whl  # the version, and with it the name, changes with every commit
# The core compiles while the packages that it and the tests need are fetched.
python -m pip wheel --quiet --no-deps --no-build-isolation --wheel-dir "$build/wheel" -C build-dir="$build" \
  -C cmake.define.STIFFMAP_TESTS=ON -C cmake.define.STIFFMAP_WERROR="${WERROR:-OFF}" . &
wheel=$!
needs='import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["project"]["dependencies"], sep="\n")'
$install --group test --requirement <(python -c "$needs")
wait "$wheel"
$install --no-deps --force-reinstall "$build"/wheel/*.whl

ctest --test-dir "$build" --output-on-failure --parallel 2
python -m pytest -n auto --dist worksteal "${lane[@]}" "$@"
