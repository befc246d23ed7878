#!/bin/sh
# What CI has no time for: a build by clang, one for aarch64, the whole suite under AddressSanitizer and
# UndefinedBehaviorSanitizer, what has threads under ThreadSanitizer, clang-tidy and cppcheck over everything, and which
# files the tests cover by less than 80 %. Some hours on two cores.
# Each part can be run alone. The last line of each part is added, with date and commit, to scripts/nightly.log.
#   scripts/nightly.sh [clang] [aarch64] [asan] [tsan] [tidy] [cppcheck] [lintian] [portable] [wheel] [coverage]
set -eu
export OMP_WAIT_POLICY=passive  # tests run side by side
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- clang aarch64 asan tsan tidy cppcheck lintian portable wheel coverage
scripts/setup.sh libgtest-dev python3 clang libomp-dev gcovr
commit="$(git describe --always --dirty)"  # before the log makes it dirty
note() { echo "$(date -u +%Y-%m-%d) $commit $1: $2" | tee -a scripts/nightly.log; }
suite() {  # NAME SANITIZERS PATTERN
  cmake -S . -B "build-$1" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DSUPERTAC_QUICK_BUILD=ON -DSUPERTAC_MPI=OFF \
    -DSUPERTAC_SANITIZE="$2" >/dev/null
  cmake --build "build-$1"
  ctest --test-dir "build-$1" -R "$3" -j 2 --output-on-failure | tee "build-$1/suite.log" || true
  note "$1" "$(grep 'tests passed' "build-$1/suite.log")"
}
for part in "$@"; do
  case "$part" in
    clang)
      cmake -S . -B build-clang -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_BUILD_TYPE=Release \
        -DSUPERTAC_QUICK_BUILD=ON -DSUPERTAC_WERROR=ON -DSUPERTAC_MPI=OFF >/dev/null
      cmake --build build-clang
      ctest --test-dir build-clang -L quick -j 2 --output-on-failure | tee build-clang/suite.log || true
      note clang "$(grep 'tests passed' build-clang/suite.log)"
      ;;
    aarch64)
      if scripts/aarch64.sh; then note aarch64 "quick tests and hashes pass"; else note aarch64 "fails or cannot be had"; fi
      ;;
    asan) suite asan address,undefined . ;;
    # libgomp is not instrumented: what OpenMP shares looks like a race.
    tsan) OMP_NUM_THREADS=1 suite tsan thread 'Journal|Web|Recorder|Stream|Collect|Rig|Serial|Board' ;;
    tidy)
      cmake -S . -B build-tidy -G Ninja -DCMAKE_CXX_COMPILER=clang++ -DCMAKE_EXPORT_COMPILE_COMMANDS=ON -DSUPERTAC_MPI=OFF \
        >/dev/null
      cmake --build build-tidy --target supertac_version
      if scripts/lint.sh build-tidy; then note tidy "no finding"; else note tidy "findings"; fi
      ;;
    # To be read, not obeyed: version 2.10 misunderstands handles, casts of vectors and sums into an array.
    cppcheck)
      scripts/setup.sh cppcheck
      cppcheck --quiet --enable=warning,portability --inline-suppr --std=c++20 --language=c++ -I . -j 2 \
        --suppress=missingIncludeSystem --suppress=cppcheckError --suppress=internalAstError --suppress=syntaxError \
        --suppress=unknownMacro io autograd layers data models hardware apps library 2>&1 | tee build-cppcheck.log
      note cppcheck "$(grep -cE '(error|warning|portability):' build-cppcheck.log) remarks"
      ;;
    lintian)
      scripts/setup.sh lintian help2man
      cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release >/dev/null
      cmake --build build
      (cd build && cpack -G DEB >/dev/null && lintian ./*.deb >lintian.log) || true
      note lintian "$(grep -c '^E:' build/lintian.log) errors"
      ;;
    portable)
      scripts/setup.sh qemu-user
      if scripts/portable.sh && packaging/portable_test.sh supertac-*.tar.xz; then
        note portable "the same bits in an empty folder and without AVX"
      else note portable "fails"; fi
      ;;
    wheel)  # Python's package: its types, and as a wheel where nothing else of ours is
      scripts/wheel.sh
      python3 -m venv build-venv
      build-venv/bin/pip install -q mypy dist/supertac-*.whl
      if (cd python && ../build-venv/bin/mypy supertac) && build-venv/bin/python tests/python/wheel_test.py; then
        note wheel "no remark on its types; trains and draws"
      else note wheel "fails"; fi
      ;;
    coverage)
      cmake -S . -B build-coverage -G Ninja -DCMAKE_BUILD_TYPE=Debug -DSUPERTAC_QUICK_BUILD=ON -DSUPERTAC_MPI=OFF \
        -DCMAKE_CXX_FLAGS="--coverage -O1" -DCMAKE_EXE_LINKER_FLAGS=--coverage >/dev/null
      cmake --build build-coverage
      ctest --test-dir build-coverage -j 2 | tail -3 || true
      # Not the kernels of each instruction set: gcovr 5 cannot add up a file that is compiled several times.
      gcovr -r . build-coverage --filter '(io|autograd|layers|data|models|hardware|apps)/' \
        --exclude autograd/kernels/fast/isa/ --csv build-coverage/files.csv --print-summary | tail -3
      note coverage "below 80 %: $(awk -F, 'NR > 1 && $4 < 0.8 { printf "%s ", $1 }' build-coverage/files.csv)"
      ;;
    *) echo "nightly.sh: expected clang, aarch64, asan, tsan, tidy, cppcheck, lintian, portable, wheel or coverage, found $part" >&2; exit 2 ;;
  esac
done
