#!/bin/sh
# The README's table on the real recordings, five seeds: presets `paper` and `tiny` on split `trial`, `paper` on the leaky split
# `window`. `best` are four of the five `paper` networks, averaged: five choices of four.
#   bench/studies/real_recordings.sh TEXT_DIR OUT_DIR [BIN_DIR]
# About half an hour on one core. A finished model is not trained again, so the script can be interrupted and rerun.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
text="$1"
out="$2"
bin="${3:-build-release/bin}"
mkdir -p "$out"
[ -d "$out/recordings" ] || "$bin/supertac-import" "$text" --out "$out/recordings"
for seed in 0 1 2 3 4; do
  for run in trial tiny window; do
    case $run in
      tiny) options="--preset tiny" ;;
      # Augmentation imitates what differs between trials; neighbouring windows of one pass have no such difference.
      window) options="--split window --augment none" ;;
      *) options="" ;;
    esac
    name="$out/${run}_s$seed"
    # shellcheck disable=SC2086 # options are several words
    [ -e "$name.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --out "$name.safetensors" --force \
      --plates 3_Bumps,6_Bumps,4_Ridges,6_Ridges --seed "$seed" $options
    [ -e "$name.json" ] || "$bin/supertac-evaluate" --model "$name.safetensors" --data "$out/recordings" \
      --json "$name.json"
  done
done
for left_out in 0 1 2 3 4; do
  four=""
  for seed in 0 1 2 3 4; do
    [ $seed = $left_out ] || four="$four${four:+,}$out/trial_s$seed.safetensors"
  done
  [ -e "$out/best_s$left_out.json" ] || "$bin/supertac-evaluate" --model "$four" --data "$out/recordings" \
    --json "$out/best_s$left_out.json"
done
python3 "$here/summarise.py" "$out"
