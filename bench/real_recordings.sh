#!/bin/sh
# Preset `paper` on the real recordings, five seeds, splits `window` and `trial`: the README's table.
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
  for split in trial window; do
    # Augmentation imitates what differs between trials; neighbouring windows of one pass have no such difference.
    augment=standard
    [ "$split" = window ] && augment=none
    name="$out/${split}_s$seed"
    [ -e "$name.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --out "$name.safetensors" --force \
      --plates 3_Bumps,6_Bumps,4_Ridges,6_Ridges --split "$split" --augment "$augment" --epochs 6 --seed "$seed"
    [ -e "$name.json" ] || "$bin/supertac-evaluate" --model "$name.safetensors" --data "$out/recordings" \
      --json "$name.json"
  done
done
python3 "$here/summarise.py" "$out"
