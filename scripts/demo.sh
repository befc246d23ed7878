#!/bin/sh
# From nothing to super-resolved pictures: installs what is missing, builds, simulates, trains, evaluates.
# Takes three to six minutes on two cores, and shows a first picture after two. Everything it makes is in out/demo; of the
# programs it builds those it needs, and scripts/test.sh or `cmake --build build` goes on from there.
#   scripts/demo.sh [--no-install]     with --no-install it ends where a package is missing, and says which
set -eu
cd "$(dirname "$0")/.."
case "$*" in
  "" | --no-install) ;;
  *) echo "demo.sh: expected no argument or --no-install, found: $*" >&2; exit 2 ;;
esac
scripts/setup.sh "$@"
out=out/demo
mkdir -p "$out"
first_picture() { # a network in one file learns beside the build, and draws what its simulated finger touches
  ${CXX:-c++} -std=c++20 -O3 examples/mini_supertac.cpp -o "$out/mini_supertac"
  (cd "$out" && ./mini_supertac >mini_supertac.log)
  echo "a first picture, by examples/mini_supertac.cpp: the surface, what the network draws of 4x4 taxels, its expected error"
  tail -c 768 "$out/mini_supertac.pgm" | od -An -v -tu1 -w16 | awk '
    { for (i = 1; i <= 16; i++) { shade = substr(" .:-=+*#%@", int($i / 25.6) + 1, 1); line[NR % 16] = line[NR % 16] shade shade }
      line[NR % 16] = line[NR % 16] "    " }
    END { for (row = 1; row <= 16; row++) print line[row % 16] }'
}
first_picture &
first=$!
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPERTAC_QUICK_BUILD=ON -DSUPERTAC_TESTS=OFF >/dev/null
cmake --build build --target supertac-simulate supertac-train supertac-evaluate
wait $first
bin=build/bin
simulate() { "$bin/supertac-simulate" --speeds 10 --force --quiet "$@"; }
plates=bumps4,bumps6,bumps12,ridges4,ridges6,ridges12
simulate --out "$out/recordings" --passes 8 --plates "$plates,plain"
simulate --out "$out/never" --passes 2 --trials 1 --plates random1,random2,random3,random4,random5,random6,random7,random8
echo "training on trial 1 of six plates and a plain one, and on plates drawn at random (two to four minutes)"
"$bin/supertac-train" --data "$out/recordings" --out "$out/model.safetensors" --preset tiny --split trial \
  --stride 4 --epochs 19 --random-plates 1000 --optimizer muon --seed 0 --force
score() { # title, name of its JSON, folder, more options
  echo
  echo "$1"
  scores="$out/$2.json"
  data="$out/$3"
  shift 3
  "$bin/supertac-evaluate" --model "$out/model.safetensors" --data "$data" --json "$scores" --force "$@"
}
score "the six plates on trial 2, which the network has not seen" known recordings --plates "$plates" --limit 10000 \
  --pictures "$out/pictures"
score "eight unseen plates" never never --split none --plates "" --limit 5000
score "the plain plate on trial 2" plain recordings --plates plain
echo "pictures: $out/pictures/strips.png and a film of each pass beside it; scores: $out/*.json;"
echo "training curves: $out/model.run/report.html"
# The same content on every processor: README says which.
hash=$(sed -n 's/.*"content": "\([^"]*\)".*/\1/p' "$out/model.run/settings.json" | cut -c1-16)
known=$(sed -n 's/.*the hash of its model, `\([^`]*\)`.*/\1/p' README.md)
if [ "$hash" = "$known" ]; then
  echo "the model's hash is $hash, as README says"
else
  echo "the model's hash is $hash, README says $known: another version made README's, or the arithmetic differs here"
fi
