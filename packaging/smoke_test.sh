#!/bin/sh
# Installs packages in a bare Debian below ROOT, does what a newcomer does, and removes them; the pages that man keeps for
# itself are man's. Run as root:
#   debootstrap --variant=minbase bookworm ROOT && packaging/smoke_test.sh ROOT build/*.deb
set -eu
root=$1
shift
cp "$@" "$root/tmp/"
export DEBIAN_FRONTEND=noninteractive
[ -e "$root/proc/self" ] || { mount -t proc proc "$root/proc" && trap 'umount "$root/proc"' EXIT; }
inside() { chroot "$root" /bin/bash -ec "$1"; }
inside 'rm -f /etc/dpkg/dpkg.cfg.d/docker; apt-get update -qq && apt-get install -y -qq --no-install-recommends man-db bash-completion'
inside 'find / -xdev \( -path "*supertac*" -o -name "*.cdx.json" \) -not -path "/tmp/*" -not -path "/var/cache/man/*" | sort >/tmp/before'
inside 'apt-get install -y -qq --no-install-recommends /tmp/supertac_*.deb'
inside 'cd /tmp && supertac --help && supertac help train | head -3 && supertac help glossary | head -1
  supertac simulate --out d --plates 6_Ridges --passes 2 --speeds 10 --quiet --force
  supertac train --data d --out m.safetensors --preset tiny --split none --epochs 1 --stride 64 --quiet --force
  supertac-stream --recording d/6_Ridges_t1_p1_v10.safetensors --model m.safetensors --out p.safetensors --quiet --force
  supertac-export m.safetensors --onnx m.onnx --force && supertac-info p.safetensors | head -3'
inside 'man -P cat supertac-train | head -5'
inside 'source /usr/share/bash-completion/bash_completion; _completion_loader supertac-train || true
  COMP_WORDS=(supertac-train --pres) COMP_CWORD=1; _supertac supertac-train; echo "completed: ${COMPREPLY[*]}"
  test "${COMPREPLY[*]}" = --preset
  COMP_WORDS=(supertac simu) COMP_CWORD=1; _supertac supertac; test "${COMPREPLY[*]}" = simulate'
inside 'apt-get purge -y -qq supertac'
inside 'find / -xdev \( -path "*supertac*" -o -name "*.cdx.json" \) -not -path "/tmp/*" -not -path "/var/cache/man/*" | sort >/tmp/after; cmp /tmp/before /tmp/after'
echo "smoke test passed: installed, run, removed without a trace"
