#!/bin/sh
# The paper's Table 1 (window length), Figure 8 (latent size x window length) and Table 2 (8, 16, 32 pixels) on the real
# recordings as accuracy.py imports them: five seeds, every fourth window (600 steps a model), unseen trial; the
# pixels on all three splits.
#   bench/studies/paper_tables.sh RECORDINGS OUT_DIR [BIN_DIR]
# About two hours on one core; what is measured is not measured again.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
data="$1"
out="$2"
bin="${3:-build-release/bin}"
mkdir -p "$out"
sweep() { # folder, options
  folder="$out/$1"
  shift
  "$bin/supertac-sweep" --data "$data" --plates 3_Bumps,6_Bumps,4_Ridges,6_Ridges --rate 100 --stride 4 --seeds 0,1,2,3,4 \
    --threads 1 --limit 1500 --out "$folder" "$@"
}
sweep pixels_trial --scale 2,4,8
sweep pixels_pass --split pass --scale 2,4,8
sweep pixels_window --split window --augment none --scale 2,4,8
# Judged on frames with 512 frames of their pass behind them, which the longest window needs.
sweep latent_timesteps --history 512 --timesteps 32,64,128,256,512 --latent 3,10,30
for folder in pixels_trial pixels_pass pixels_window latent_timesteps; do
  python3 "$here/sweep_statistics.py" "$out/$folder/sweep.csv"
done
