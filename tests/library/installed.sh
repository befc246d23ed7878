#!/bin/sh
# From an installed SuperTac in an odd prefix: the C example, train and inlined arithmetic through pkg-config.
#   installed.sh SOURCE PREFIX LIBDIR BUILD
set -eu
source=$1 prefix=$2 libdir=$3 build=$4
export PKG_CONFIG_PATH="$prefix/$libdir/pkgconfig" LD_LIBRARY_PATH="$prefix/$libdir"
mkdir -p "$build"
cd "$build"
fail() {
  echo "$1"
  exit 1
}
# shellcheck disable=SC2046  # flags are words
cc -std=c99 -Wall -Wextra -Werror "$source/examples/draw_live.c" -o draw_live $(pkg-config --cflags --libs supertac)
./draw_live missing.safetensors 100 < /dev/null 2> said && fail "a missing model is no error"
grep -q "missing.safetensors" said || fail "the error does not name the file: $(cat said)"
# shellcheck disable=SC2046
c++ -std=c++20 -O1 "$source/examples/train.cpp" -o train $(pkg-config --cflags --libs supertac-cpp)
./train missing out.safetensors 1 8 2> said && fail "a missing folder is no error"
grep -q "missing" said || fail "the error does not name the folder: $(cat said)"
flags=$(pkg-config --cflags supertac-cpp)
# shellcheck disable=SC2086
c++ -std=c++20 -O0 $flags "$source/tests/library/inlined_bits.cpp" -o plain
# shellcheck disable=SC2086
c++ -std=c++20 -O3 -march=native $flags "$source/tests/library/inlined_bits.cpp" -o native
[ "$(./plain)" = "$(./native)" ] || fail "-O3 -march=native gives other bits"
visible=$(nm -D --defined-only "$prefix/$libdir/libsupertac.so" | awk '$2 != "A" {print $3}' | grep -v '^supertac_' || true)
[ -z "$visible" ] || fail "the C library shows more than its interface: $visible"
echo "all linked from $prefix"
