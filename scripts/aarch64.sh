#!/bin/sh
# Builds libraries, tests and supertac-check for aarch64 and runs them under emulation: the quick tests pass, and the bits
# there are those of x86. Left out are serial ports, as qemu does not know how their rate is set. With a model and recordings it also prints the content hash of the pictures of 1,000 windows, to be
# compared with that of `supertac-evaluate --limit 1000 --outputs` here. Adds Debian's arm64 packages beside this machine's
# own; half an hour on two cores. Ends with 77 where they cannot be had.
#   scripts/aarch64.sh [MODEL DATA]
set -eu
tree="$(cd "$(dirname "$0")/.." && pwd)"
if ! dpkg --print-foreign-architectures | grep -qx arm64; then
  as_root=""
  [ "$(id -u)" -eq 0 ] || as_root=sudo
  $as_root dpkg --add-architecture arm64
fi
"$tree/scripts/setup.sh" g++-aarch64-linux-gnu qemu-user libgomp1:arm64 libgtest-dev:arm64 libkissfft-dev:arm64 \
  libmicrohttpd-dev:arm64 zlib1g-dev:arm64 || {
  echo "aarch64.sh: skipped, as the packages of arm64 cannot be had here"
  exit 77
}
build="${SUPERTAC_BUILD:-$tree/build-aarch64}"
# shellcheck disable=SC2086
cmake -S "$tree" -B "$build" -G Ninja -DCMAKE_TOOLCHAIN_FILE="$tree/cmake/aarch64.cmake" -DSUPERTAC_MPI=OFF \
  ${SUPERTAC_CMAKE:-} >/dev/null
cmake --build "$build" --target supertac-check io_test autograd_test autograd_f64_test layers_test layers_f64_test \
  parity_test data_test models_test
qemu-aarch64 "$build/bin/supertac-check" bits
ctest --test-dir "$build" -L quick -E '^(Docs|Examples|Lessons)\.|^Windows.OfAnyArray' --output-on-failure -j 2
[ $# -eq 2 ] || exit 0
cmake --build "$build" --target supertac-evaluate supertac-info
pictures="$(mktemp -d)"
trap 'rm -r "$pictures"' EXIT
qemu-aarch64 "$build/bin/supertac-evaluate" --model "$1" --data "$2" --limit 1000 --outputs "$pictures/a.safetensors" --quiet
qemu-aarch64 "$build/bin/supertac-info" "$pictures/a.safetensors" | grep content
