#!/bin/sh
# Figure 11: textures told apart from raw frames and from super-resolved pictures, splits `trial`, `pass` and `window`,
# five models and classifiers each. Models and recordings are those of accuracy.py; models it lacks are trained.
#   bench/studies/classification.sh OUT_DIR [BIN_DIR]
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
out="$1"
bin="${2:-build-release/bin}"
for split in trial pass window; do
  augment=standard
  [ "$split" = window ] && augment=none
  models=""
  for seed in 0 1 2 3 4; do
    model="$out/${split}_s$seed.safetensors"
    [ -e "$model" ] || "$bin/supertac-train" --data "$out/recordings" --out "$model" --force \
      --plates 3_Bumps,6_Bumps,4_Ridges,6_Ridges --split "$split" --augment "$augment" --seed "$seed"
    models="$models${models:+,}$model"
  done
  [ -e "$out/classify_$split.json" ] || "$bin/supertac-classify" --model "$models" --data "$out/recordings" \
    --augment "$augment" --json "$out/classify_$split.json" \
    --views frame,bicubic,super_resolved,latents,history32,history256,truth
done
python3 "$here/classification.py" "$out"/classify_*.json
