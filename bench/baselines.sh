#!/bin/sh
# What the network's parts buy: preset `paper` against sub-pixel convolution, a plain autoencoder, a network that sees one
# frame only, and what needs no training. Split `trial`, real recordings as real_recordings.sh imports them.
#   bench/baselines.sh OUT_DIR [BIN_DIR] [SEED] [STRIDE]
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
out="$1"
bin="${2:-build-release/bin}"
seed="${3:-0}"
stride="${4:-1}"
plates=3_Bumps,6_Bumps,4_Ridges,6_Ridges
train() { # name, options
  model="$out/baseline_$1_s$seed"
  name="$1"
  shift
  [ -e "$model.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --plates $plates --split trial --rate 100 \
    --stride "$stride" --epochs 10 --seed "$seed" --out "$model.safetensors" --force "$@"
  [ -e "$model.json" ] || "$bin/supertac-evaluate" --model "$model.safetensors" --data "$out/recordings" --json "$model.json"
}
train paper
train sub-pixel --upsampling sub-pixel
train plain-autoencoder --autoencoder plain
frame="$out/baseline_frame_s$seed"
[ -e "$out/pairs/test.safetensors" ] || "$bin/supertac-pairs" --data "$out/recordings" --plates $plates --stride 4 --out "$out/pairs"
[ -e "$frame.safetensors" ] || "$bin/supertac-train" --pairs "$out/pairs/train.safetensors" --split none --epochs 10 \
  --seed "$seed" --out "$frame.safetensors" --force
[ -e "$frame.json" ] || "$bin/supertac-evaluate" --model "$frame.safetensors" --pairs "$out/pairs/test.safetensors" \
  --split none --json "$frame.json"
python3 "$here/baselines.py" "$out"
