#!/bin/sh
# Preset `paper` on the real recordings, five seeds, splits `window` and `trial` at the paper's 300 Hz and `trial` at 100 Hz,
# where the same 256 samples span three times as much of the plate: the README's table.
#   bench/real_recordings.sh TEXT_DIR OUT_DIR [BIN_DIR]
# About an hour on one core. A finished model is not trained again, so the script can be interrupted and rerun.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
text="$1"
out="$2"
bin="${3:-build-release/bin}"
mkdir -p "$out"
[ -d "$out/recordings" ] || "$bin/supertac-import" "$text" --out "$out/recordings"
for seed in 0 1 2 3 4; do
  for run in trial window trial_100hz; do
    # Augmentation imitates what differs between trials; neighbouring windows of one pass have no such difference.
    augment=standard
    [ "$run" = window ] && augment=none
    rate="--rate 300 --epochs 6"
    [ "$run" = trial_100hz ] && rate="--rate 100 --epochs 10"
    name="$out/${run}_s$seed"
    [ -e "$name.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --out "$name.safetensors" --force \
      --plates 3_Bumps,6_Bumps,4_Ridges,6_Ridges --split "${run%_100hz}" --augment "$augment" $rate --seed "$seed"
    [ -e "$name.json" ] || "$bin/supertac-evaluate" --model "$name.safetensors" --data "$out/recordings" \
      --json "$name.json"
  done
done
python3 "$here/summarise.py" "$out"
