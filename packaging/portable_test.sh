#!/bin/sh
# The archive of scripts/portable.sh where nothing else is: in an empty folder, in each ROOT (made by debootstrap), and on an
# emulated processor without AVX. A newcomer's commands run there, and what they make has the same hashes everywhere. Root:
#   packaging/portable_test.sh supertac-0.2.0-linux-x86_64.tar.xz [ROOT ...]
set -eu
archive=$(realpath "$1")
shift
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
name=$(tar -tf "$archive" | head -1 | cut -d/ -f1)
tar -C "$work" -xf "$archive"

# newcomer RUNNER...: what the programs say of their bits and of what was made in $home; RUNNER runs bin/supertac-JOB.
newcomer() {
  "$@" check bits
  "$@" simulate --out "$home/d" --plates 6_Ridges --passes 2 --speeds 10 --quiet
  "$@" train --data "$home/d" --out "$home/m.safetensors" --preset tiny --split none --epochs 1 --stride 64 --quiet
  "$@" stream --recording "$home/d/6_Ridges_t1_p1_v10.safetensors" --model "$home/m.safetensors" --out "$home/p.safetensors" \
    --mcap "$home/p.mcap" --seconds 3 --quiet
  "$@" export "$home/m.safetensors" --onnx "$home/m.onnx" --quiet
  for file in m p; do "$@" info "$home/$file.safetensors" | grep content; done
}
# supertac-check says them once for each kind of kernels that the processor has.
hashes() { grep -oE '\b[0-9a-f]{16,64}\b' | sort -u | sha256sum; }

inside() {  # ROOT JOB OPTION...
  root=$1 job=$2
  shift 2
  TMPDIR=/tmp chroot "$root" "/opt/$name/bin/supertac-$job" "$@"
}
emulated() {
  job=$1
  shift
  qemu-x86_64 -cpu Nehalem "$work/$name/bin/supertac-$job" "$@"
}

home=/tmp/newcomer  # everywhere, since files name their source
mkdir "$work/empty" "$home"
trap 'rm -rf "$work" "$home"' EXIT
expected=""
for place in "$work/empty" "$@" emulated; do
  case "$place" in
    emulated) newcomer emulated >"$work/said" ;;
    *)
      mkdir -p "$place/opt" "$place/tmp"
      rm -rf "$place$home" "$place/opt/$name"
      mkdir "$place$home"
      cp -r "$work/$name" "$place/opt/"
      newcomer inside "$place" >"$work/said"
      rm -rf "$place$home" "$place/opt/$name"
      ;;
  esac
  found=$(hashes <"$work/said")
  [ "$found" = "${expected:=$found}" ] || { echo "$place: other bits:"; cat "$work/said"; exit 1; }
  echo "$place: runs, hash ${found%% *}"
done
