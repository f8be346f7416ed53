#!/usr/bin/env bash
# The bindings under the address and undefined-behaviour sanitizers: Python tests that hand every kind of array over,
# good and bad, on one thread and on several.   tests/sanitized.sh build/dev
set -euo pipefail
build=$PWD/$1
package=$build/package
rm -rf "$package"
mkdir -p "$package"
cp -r python/stiffmap "$package/"
cp "$build"/python/bindings/_core*.so "$package/stiffmap/"
export LD_PRELOAD="$(c++ -print-file-name=libasan.so) $(c++ -print-file-name=libstdc++.so)"
export ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1  # Python itself leaks
export PYTHONPATH=$package PYTHONSAFEPATH=1 OPENBLAS_NUM_THREADS=1
python -c "import stiffmap, sys; sys.exit(not stiffmap.__file__.startswith('$package'))"
cd tests/python
python -m pytest -n 2 -m "not slow" -p no:cacheprovider solve/test_bad_arrays.py solve/test_singular_poses.py \
  solve/compiled/test_one_pose.py solve/compiled/test_determinism.py
