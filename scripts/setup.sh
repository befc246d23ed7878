#!/bin/sh
# Installs the Debian packages that building needs, those that are missing only, and says which before it does.
#   scripts/setup.sh [--no-install] [MORE PACKAGES]     with --no-install it says which are missing and ends with 1
set -eu
install=yes
if [ "${1:-}" = --no-install ]; then
  install=no
  shift
fi
packages="g++ cmake ninja-build nlohmann-json3-dev libcxxopts-dev libkissfft-dev libmicrohttpd-dev libstb-dev
  zlib1g-dev $*"
missing=""
for package in $packages; do
  dpkg-query -W -f '${db:Status-Status}\n' "$package" 2>/dev/null | grep -qx installed || missing="$missing $package"
done
[ -n "$missing" ] || exit 0
if [ "$install" = no ]; then
  echo "setup.sh: missing, and not installed because of --no-install:$missing" >&2
  exit 1
fi
echo "installing by apt-get:$missing"
as_root=""
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "setup.sh: not root and no sudo; install as root:$missing" >&2; exit 1; }
  as_root=sudo
fi
export DEBIAN_FRONTEND=noninteractive
$as_root apt-get update -qq
# shellcheck disable=SC2086
$as_root apt-get install -y -qq --no-install-recommends $missing >/dev/null
