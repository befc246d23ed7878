#!/bin/sh
# What helps on an unseen trial: each line of the list below is trained briefly (about 77,000 windows, preset
# `paper`) and scored on trial 2. Results: OUT_DIR/generalisation.csv.
#   bench/studies/generalisation.sh TEXT_DIR OUT_DIR [BIN_DIR]
# About two minutes an idea on one core. A finished model is not trained again.
set -eu
text="$1"
out="$2"
bin="${3:-build-release/bin}"
mkdir -p "$out"
plates=3_Bumps,6_Bumps,4_Ridges,6_Ridges
[ -d "$out/recordings" ] || "$bin/supertac-import" "$text" --out "$out/recordings"
[ -d "$out/simulated" ] || "$bin/supertac-simulate" --out "$out/simulated" --plates "$plates" --speeds 10 --trials 4 \
  --passes 3 --from 4 --to 90
echo "idea,options,seed,contact_ssim,contact_psnr_db,position_error_mm,all_ssim,all_psnr_db" > "$out/generalisation.csv"
while IFS=';' read -r idea options seed; do
  name="$out/$(echo "$idea" | tr ' ' '_')_s$seed"
  # shellcheck disable=SC2086 # options are several words
  [ -e "$name.safetensors" ] || "$bin/supertac-train" --data "$out/recordings" --plates "$plates" --split trial --force \
    --out "$name.safetensors" --seed "$seed" $options
  [ -e "$name.json" ] || "$bin/supertac-evaluate" --model "$name.safetensors" --data "$out/recordings" --json "$name.json"
  python3 - "$idea" "$options" "$seed" "$name.json" >> "$out/generalisation.csv" << 'END'
import json, sys
idea, options, seed, path = sys.argv[1:]
scores = json.load(open(path))
contact, every = scores["contact"], scores["all"]
print(idea, options, seed, *(f"{v:.3f}" for v in (contact["ssim"], contact["psnr_mean_db"], contact["position_error_mm"],
                                                  every["ssim"], every["psnr_mean_db"])), sep=",")
END
done << END
base;--stride 6 --epochs 10 --rate 300 --scaling fixed;0
SSIM weighs more;--stride 6 --epochs 10 --lambda 0.5 --rate 300 --scaling fixed;0
T 512;--stride 6 --epochs 10 --timesteps 512 --rate 300 --scaling fixed;0
100 Hz;--rate 100 --stride 2 --epochs 10 --scaling fixed;0
100 Hz again;--rate 100 --stride 2 --epochs 10 --scaling fixed;1
75 Hz;--rate 75 --stride 2 --epochs 13 --scaling fixed;0
100 Hz and SSIM weighs more;--rate 100 --stride 2 --epochs 10 --lambda 0.4 --scaling fixed;0
100 Hz and columns grouped;--rate 100 --stride 2 --epochs 10 --grouping vertical --scaling fixed;0
100 Hz and more KL;--rate 100 --stride 2 --epochs 10 --beta 0.01 --scaling fixed;0
100 Hz and less KL;--rate 100 --stride 2 --epochs 10 --beta 0.0001 --scaling fixed;0
100 Hz and simulated passes;--rate 100 --stride 2 --epochs 6 --also $out/simulated --scaling fixed;0
levelled;--stride 2 --epochs 10;0
levelled and all windows;--epochs 10;0
levelled and all windows and SSIM weighs more;--epochs 10 --lambda 0.3;0
levelled and all windows twice as long;--epochs 20;0
END
