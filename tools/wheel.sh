#!/usr/bin/env bash
# Wheels that run on other machines, one for each CPython from 3.11 on that is found here: dist/*.whl and their sizes.
#   tools/wheel.sh [X.Y ...]     only these versions of Python; NICE=19 lowers the priority
# Interpreters are looked for in PATH and below ~/.pyenv/versions. Needs a C++20 compiler; uses ccache where it is found:
# the core is the same for every Python, so that only the bindings are compiled again. auditwheel names the oldest glibc
# that a wheel runs with: that of a build in a manylinux container (cibuildwheel) is older than that of a build here.
set -euo pipefail
cd "$(dirname "$0")/.."
work=$PWD/build/wheel
mkdir -p "$work" dist
quiet="-m pip --disable-pip-version-check --quiet"

# One interpreter per version: "3.11 /usr/bin/python3.11".
asks='import sys; sys.version_info >= (3, 11) and sys.implementation.name == "cpython" and print("%d.%d" % sys.version_info[:2])'
declare -A pythons
for python in $(compgen -c python3. | grep -E '^python3\.[0-9]+$' | sort -u) python3 ~/.pyenv/versions/*/bin/python; do
  path=$(command -v "$python") || continue
  version=$("$path" -c "$asks" 2>/dev/null) || continue
  [ -z "$version" ] || [ -n "${pythons[$version]:-}" ] || pythons[$version]=$path
done
wanted=("$@")
[ ${#wanted[@]} -gt 0 ] || mapfile -t wanted < <(printf '%s\n' "${!pythons[@]}" | sort -V)
[ ${#wanted[@]} -gt 0 ] || { echo "tools/wheel.sh: no CPython 3.11 or newer is found"; exit 1; }

options=(-C cmake.define.Eigen3_DIR="$work/eigen/cmeel.prefix/share/eigen3/cmake")
if command -v ccache >/dev/null; then
  options+=(-C cmake.define.CMAKE_CXX_COMPILER_LAUNCHER=ccache)
  export CCACHE_BASEDIR=${CCACHE_BASEDIR:-$PWD} CCACHE_NOHASHDIR=1
fi

for version in "${wanted[@]}"; do
  python=${pythons[$version]:-}
  [ -n "$python" ] || { echo "tools/wheel.sh: Python $version is not found (found: ${!pythons[*]})"; exit 1; }
  here=$work/$version
  [ -x "$here/venv/bin/python" ] || "$python" -m venv "$here/venv"
  bin=$here/venv/bin
  "$bin/python" $quiet install --upgrade "pip>=25.1"
  "$bin/python" $quiet install --group build --group wheel
  [ -d "$work/eigen" ] || "$bin/python" $quiet install --no-deps --target "$work/eigen" "cmeel-eigen>=3.4"
  rm -rf "$here/raw" "$here/repaired"
  PATH="$bin:$PATH" nice -n "${NICE:-0}" "$bin/python" -m pip --quiet wheel --no-deps --no-build-isolation \
    --wheel-dir "$here/raw" -C build-dir="$here/build" "${options[@]}" .
  PATH="$bin:$PATH" "$bin/auditwheel" repair --strip --wheel-dir "$here/repaired" "$here"/raw/*.whl 2>"$here/auditwheel.log" >&2 || { cat "$here/auditwheel.log"; exit 1; }
  tag=cp${version/./}
  rm -f dist/stiffmap-*-"$tag"-"$tag"-*.whl
  mv "$here"/repaired/*.whl dist/
  for wheel in dist/stiffmap-*-"$tag"-"$tag"-*.whl; do
    echo "$wheel  $(du -k --apparent-size "$wheel" | cut -f1) kB"
  done
done
