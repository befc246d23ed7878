#!/bin/sh
# Accuracy against cost on the unseen trial: the presets, `paper` with a plain autoencoder, networks that see one frame (ours;
# SRCNN- and GAN-style after Wu 2022), and what needs no training.
# Five seeds. OUT_DIR is that of real_recordings.sh, whose recordings and models are used.
#   bench/studies/baselines.sh OUT_DIR [BIN_DIR]
# About an hour on one core; what is there is not made again. Results: OUT_DIR/baselines.csv; baselines.gp draws them.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
out="$1"
bin="${2:-build-release/bin}"
plates=3_Bumps,6_Bumps,4_Ridges,6_Ridges
train() { # name, options
  model="$out/$1"
  shift
  [ -e "$model.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --plates $plates --split trial --seed "$seed" \
    --threads 1 --out "$model.safetensors" --force "$@"
  evaluate "$model" --data "$out/recordings"
}
evaluate() { # model, options
  model="$1"
  shift
  [ -e "$model.json" ] || "$bin/supertac-evaluate" --model "$model.safetensors" --json "$model.json" --threads 1 "$@"
}
for seed in 0 1 2 3 4; do
  train "trial_s$seed"
  # One-frame networks learn from and are scored on the windows of `paper`, whose split is the same for every seed.
  [ -e "$out/pairs/test.safetensors" ] || "$bin/supertac-evaluate" --model "$out/trial_s0.safetensors" \
    --data "$out/recordings" --write-pairs "$out/pairs"
  train "tiny_s$seed" --preset tiny
  train "plain-autoencoder_s$seed" --autoencoder plain
  frame="$out/frame_s$seed"
  [ -e "$frame.safetensors" ] || "$bin/supertac-train" --pairs "$out/pairs/train.safetensors" --split none --epochs 10 \
    --seed "$seed" --threads 1 --out "$frame.safetensors" --force
  evaluate "$frame" --pairs "$out/pairs/test.safetensors" --split none
  for method in srcnn srgan; do
    [ -e "$out/${method}_s$seed.json" ] || "$bin/wu_upsamplers" --train "$out/pairs/train.safetensors" \
      --test "$out/pairs/test.safetensors" --method $method --seed "$seed" --threads 1 --json "$out/${method}_s$seed.json"
  done
done
python3 "$here/baselines.py" "$out" > "$out/baselines.csv"
