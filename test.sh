#!/usr/bin/env bash
# All tests, C++ and Python, in an environment of their own. Needs Python >= 3.11 and a C++20 compiler.
#   ./test.sh [pytest arguments]        VENV=folder and PYTHON=interpreter may be set
set -euo pipefail
cd "$(dirname "$0")"
venv=${VENV:-.venv}
build=build/tests

[ -x "$venv/bin/python" ] || "${PYTHON:-python3}" -m venv "$venv"
export PATH="$PWD/$venv/bin:$PATH"
python -m pip install --quiet --upgrade "pip>=25.1"
python -m pip install --quiet . --group test

cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSTIFFMAP_TESTS=ON -DSTIFFMAP_PYTHON=OFF \
 -DPython_EXECUTABLE="$PWD/$venv/bin/python"
cmake --build "$build"
ctest --test-dir "$build" --output-on-failure

python -m pytest "$@"
