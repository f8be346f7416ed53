#!/usr/bin/env bash
# Builds stiffmap and installs it in an environment of its own. Needs Python >= 3.11 and a C++20 compiler.
#   ./install.sh [options of pip wheel]     VENV=folder (.venv) and PYTHON=interpreter (python3) may be set
# What is compiled stays in build/core, so that the next call compiles only what has changed.
set -euo pipefail
cd "$(dirname "$0")"
venv=${VENV:-.venv}
[ -x "$venv/bin/python" ] || "${PYTHON:-python3}" -m venv "$venv"
export PATH="$PWD/$venv/bin:$PATH"
install="python -m pip install --quiet --no-compile"
$install --upgrade "pip>=25.1"
$install --constraint tests/versions.txt --group build
rm -f build/wheel/*.whl  # the version, and with it the name, changes with every commit
python -m pip wheel -v --no-deps --no-build-isolation --wheel-dir build/wheel -C build-dir=build/core "$@" .
$install --force-reinstall --no-deps build/wheel/*.whl
$install build/wheel/*.whl
