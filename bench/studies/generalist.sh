#!/bin/sh
# Plates never felt, and silence: a generalist learns from real passes and from random plates. Leave one plate out over all
# real plates, the four known plates on the unseen trial, and simulated plates that no training drew; the specialist beside
# it. Blind protocol (bench/README.md): choices were made on trial 1; this script is what looks at trial 2.
#   bench/studies/generalist.sh TEXT_DIR OUT_DIR [BIN_DIR] [SEEDS]
# About four minutes a network on one core, 18 networks a seed. A finished model is not trained again.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
text="$1"
out="$2"
bin="${3:-build-release/bin}"
seeds="${4:-0 1 2 3 4}"
known=3_Bumps,6_Bumps,4_Ridges,6_Ridges
recipe="--preset tiny --latent 20 --stride 4 --epochs 12 --random-plates 1500"
mkdir -p "$out"
[ -d "$out/recordings" ] || "$bin/supertac-import" "$text" --out "$out/recordings"
random=$(seq -f random%g -s, 1 24)
[ -d "$out/never" ] || "$bin/supertac-simulate" --out "$out/never" --plates "$random" --speeds 10 --trials 1 --passes 2
[ -d "$out/plain" ] || "$bin/supertac-simulate" --out "$out/plain" --plates plain --speeds 10 --trials 2 --passes 8
train() { # name, options of supertac-train
  name="$1"
  shift
  [ -e "$out/$name.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --out "$out/$name.safetensors" --force \
    --threads 1 "$@"
}
score() { # name, of what, options of supertac-evaluate
  name="$1"
  what="$2"
  shift 2
  [ -e "$out/$name.$what.json" ] || "$bin/supertac-evaluate" --model "$out/$name.safetensors" --threads 1 \
    --json "$out/$name.$what.json" "$@"
}
for seed in $seeds; do
  for plate in 3_Bumps 6_Bumps 4_Ridges 6_Ridges 4_Blob 6_Blob 4_Waves 6_Waves; do
    # shellcheck disable=SC2086 # a recipe is several words
    train "generalist_without_${plate}_s$seed" --split texture --leave-out $plate --seed "$seed" $recipe
    score "generalist_without_${plate}_s$seed" left_out --data "$out/recordings"
    train "specialist_without_${plate}_s$seed" --split texture --leave-out $plate --seed "$seed" --plates $known,$plate \
      --preset tiny --epochs 12
    score "specialist_without_${plate}_s$seed" left_out --data "$out/recordings"
  done
  # shellcheck disable=SC2086
  train "generalist_s$seed" --split trial --seed "$seed" $recipe
  train "specialist_s$seed" --split trial --seed "$seed" --plates $known --preset tiny
  for kind in generalist specialist; do
    score "${kind}_s$seed" trial --data "$out/recordings" --plates $known
    score "${kind}_s$seed" never --data "$out/never" --split none --plates ""
    score "${kind}_s$seed" plain --data "$out/plain" --split none --plates ""
  done
done
python3 "$here/generalist.py" "$out" > "$out/generalist.csv"
