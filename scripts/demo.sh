#!/bin/sh
# From nothing to super-resolved pictures: installs what is missing, builds, simulates, trains, evaluates.
# Takes some minutes on two cores. Everything it makes is in out/demo.
set -eu
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "building"
cmake -S . -B build-demo -G Ninja -DCMAKE_BUILD_TYPE=Release -DSUPERTAC_TESTS=OFF >/dev/null
cmake --build build-demo | grep -iE 'error|warning' || true
bin=build-demo/bin
out=out/demo
mkdir -p "$out"
"$bin/supertac-simulate" --out "$out/recordings" --seed 1 --force
echo "training on trial 1 (about a minute and a half)"
"$bin/supertac-train" --data "$out/recordings" --out "$out/model.safetensors" --split trial --stride 2 --epochs 4 \
  --seed 0 --force
echo "testing on trial 2, which the network has not seen"
"$bin/supertac-evaluate" --model "$out/model.safetensors" --data "$out/recordings" --limit 10000 \
  --pictures "$out/pictures" --json "$out/scores.json" --force
echo "pictures: $out/pictures/strips.png and a film of each pass beside it; scores: $out/scores.json;"
echo "training curves: $out/model.run/report.html"
