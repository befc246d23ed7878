#!/bin/sh
# Builds everything and runs every test. SUPERTAC_RECORDINGS=DIR adds those that need the real recordings;
# SUPERTAC_CMAKE adds options, e.g. SUPERTAC_CMAKE="-DSUPERTAC_SANITIZE=address,undefined".
set -eu
cd "$(dirname "$0")/.."
scripts/setup.sh libgtest-dev python3
build="${SUPERTAC_BUILD:-build}"
# shellcheck disable=SC2086
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPERTAC_QUICK_BUILD=ON -DSUPERTAC_TESTS=ON \
  ${SUPERTAC_CMAKE:-} >/dev/null
cmake --build "$build"
[ -n "${SUPERTAC_RECORDINGS:-}" ] || echo "SUPERTAC_RECORDINGS is not set: tests on real recordings check nothing"
# Threads that wait leave the processor to other tests.
OMP_WAIT_POLICY=passive ctest --test-dir "$build" --output-on-failure -j 4  # many of them wait
