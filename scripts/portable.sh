#!/bin/sh
# One archive for any Linux on x86-64, supertac-VERSION-linux-x86_64.tar.xz in this folder: static programs, man pages and
# examples, which need nothing installed. libmicrohttpd (without TLS, which the live page has no use for) and kissfft are
# compiled from Debian's sources: its packages hold nothing of them that links statically.
#   scripts/portable.sh && packaging/portable_test.sh supertac-*.tar.xz
set -eu
cd "$(dirname "$0")/.."
scripts/setup.sh help2man xz-utils make
build="$PWD/${SUPERTAC_BUILD:-build-portable}"
parts="$build/parts"
mkdir -p "$parts"
if [ ! -e "$parts/lib/libmicrohttpd.a" ]; then
  (
    cd "$parts"
    mkdir -p apt lists/partial cache/archives/partial lib
    for list in /etc/apt/sources.list.d/*.sources; do sed 's/^Types:.*/Types: deb-src/' "$list" >"apt/${list##*/}"; done
    sed 's/^deb /deb-src /' /etc/apt/sources.list >apt/own.list 2>/dev/null || true
    set -- -qq -o Dir::Etc::sourcelist=/dev/null -o "Dir::Etc::sourceparts=$parts/apt" -o "Dir::State::lists=$parts/lists" \
      -o "Dir::Cache=$parts/cache" -o APT::Sandbox::User=
    apt-get "$@" update
    apt-get "$@" source --download-only libmicrohttpd kissfft
    for archive in *.orig.tar.*; do tar -xf "$archive"; done
    # "set -e" is off here, left of ||.
    (cd kissfft-*/ && cc -O2 -fPIC -ffp-contract=off -c kiss_fft.c kiss_fftr.c && ar rcs ../lib/libkissfft-float.a kiss_*.o) || exit 1
    (cd libmicrohttpd-*/ && ./configure --quiet --disable-shared --disable-https --disable-curl --disable-doc \
      --disable-examples --with-pic CFLAGS=-O2 && make -s -C src/microhttpd) || exit 1
    cp libmicrohttpd-*/src/microhttpd/.libs/libmicrohttpd.a lib/
  ) >"$parts/log" 2>&1 || { tail -20 "$parts/log"; exit 1; }
fi
cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPERTAC_TESTS=OFF -DSUPERTAC_MPI=OFF -DSUPERTAC_WERROR=ON \
  -DCMAKE_EXE_LINKER_FLAGS="-static -L$parts/lib" -DCMAKE_SHARED_LINKER_FLAGS="-L$parts/lib" \
  -DMICROHTTPD_LIBRARY="$parts/lib/libmicrohttpd.a" -DOpenMP_gomp_LIBRARY=-lgomp \
  -DOpenMP_pthread_LIBRARY=-lpthread -DZLIB_LIBRARY="$(c++ -print-file-name=libz.a)" -DCMAKE_DISABLE_FIND_PACKAGE_Python3=ON >/dev/null
cmake --build "$build"
version=$(sed -n 's/^project(supertac VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
name="supertac-$version"
rm -rf "${build:?}/$name"
cmake --install "$build" --component programs --strip --prefix "$build/$name" >/dev/null
rm -r "${build:?}/$name/lib"  # the C library is for programs that are compiled here
cp -r examples "$build/$name/examples"
cp LICENSE README.md "$build/$name/"
archive="$name-linux-$(uname -m).tar.xz"
tar -C "$build" --sort=name --owner=0 --group=0 --numeric-owner --mtime="@${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}" \
  -c "$name" | xz -9 -T1 >"$archive"
echo "$archive: $(($(stat -c %s "$archive") / 1000)) kB"
