#!/bin/sh
# The simulator against reality: networks that have seen simulated passes only, scored on the real unseen trial. The whole
# simulator with five seeds, then without each of its terms with seed 0 (and whichever more are named).
#   bench/studies/simulator_ablation.sh OUT_DIR [BIN_DIR] [SEEDS_OF_A_TERM]
# OUT_DIR is that of real_recordings.sh. About two minutes a network on one core; what is there is not made again.
# Results: OUT_DIR/simulator_ablation.csv.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
out="$1"
bin="${2:-build-release/bin}"
seeds="${3:-0}"
plates=3_Bumps,6_Bumps,4_Ridges,6_Ridges
train() { # name, seed, options of supertac-simulate
  name="$1"
  seed="$2"
  shift 2
  model="$out/simulated/${name}_s$seed"
  [ -e "$model.json" ] && return
  [ -e "$model.safetensors" ] || [ -d "$out/simulated/$name" ] || "$bin/supertac-simulate" --out "$out/simulated/$name" --plates $plates --speeds 10 \
    --trials 12 --passes 4 --from 4 --to 90 "$@"
  [ -e "$model.safetensors" ] || "$bin/supertac-train" --data "$out/simulated/$name" --split none --stride 4 --epochs 10 \
    --seed "$seed" --threads 1 --out "$model.safetensors" --force
  "$bin/supertac-evaluate" --model "$model.safetensors" --data "$out/recordings" --plates $plates --split trial --threads 1 \
    --json "$model.json"
}
mkdir -p "$out/simulated"
for seed in 0 1 2 3 4; do train whole "$seed"; done
for term in mount pad dome edges tilt gains variation vibration drift emi noise adc filter saturation jitter loss; do
  for seed in $seeds; do train "without_$term" "$seed" --without $term; done
  rm -rf "$out/simulated/without_$term"
done
python3 "$here/simulator_ablation.py" "$out/simulated" > "$out/simulator_ablation.csv"
