#!/bin/sh
# Plates never felt, and silence: a generalist learns from real passes and from random plates, a specialist from real
# passes, and both together recall or feel (models/inference/committee.h). Leave one plate out over all real plates, the four known
# plates on the unseen trial, and simulated plates that no training drew. Blind protocol (bench/README.md): choices were
# made on trial 1; this script is what looks at trial 2.
#   bench/studies/generalist.sh TEXT_DIR OUT_DIR [BIN_DIR] [SEEDS]
# About six minutes a network on one core, 18 networks a seed. A finished model is not trained again.
set -eu
here="$(cd "$(dirname "$0")" && pwd)"
text="$(cd "$1" && pwd)"
out="$2"
bin="${3:-build-release/bin}"
seeds="${4:-0 1 2 3 4}"
known=3_Bumps,6_Bumps,4_Ridges,6_Ridges
plates="3_Bumps 6_Bumps 4_Ridges 6_Ridges 4_Blob 6_Blob 4_Waves 6_Waves"
recipe="--preset tiny --latent 20 --stride 4 --epochs 12 --random-plates 1500"
mkdir -p "$out"
[ -d "$out/recordings" ] || "$bin/supertac-import" "$text" --out "$out/recordings"
mkdir -p "$out/trial1" # aligned with trial 2, as the import does; nothing else of trial 2 is in it
for file in "$out"/recordings/*_t1_*; do
  ln -sf "../recordings/$(basename "$file")" "$out/trial1/"
done
for plate in $plates; do
  mkdir -p "$out/text2/$plate"
  ln -sfn "$text/$plate/2" "$out/text2/$plate/2"
done
[ -d "$out/alone" ] || "$bin/supertac-import" "$out/text2" --out "$out/alone"
random=$(seq -f random%g -s, 1 24)
[ -d "$out/never" ] || "$bin/supertac-simulate" --out "$out/never" --plates "$random" --speeds 10 --trials 1 --passes 2
[ -d "$out/plain" ] || "$bin/supertac-simulate" --out "$out/plain" --plates plain --speeds 10 --trials 2 --passes 8
train() { # name, folder of recordings, options of supertac-train
  name="$1"
  data="$out/$2"
  shift 2
  [ -e "$out/$name.safetensors" ] || "$bin/supertac-train" --data "$data" --out "$out/$name.safetensors" --force \
    --threads 1 "$@"
}
score() { # name with "both" for specialist and generalist, of what, folder of recordings, options of supertac-evaluate
  case $1 in
    both*) models="$out/specialist${1#both}.safetensors,$out/generalist${1#both}.safetensors" ;;
    *) models="$out/$1.safetensors" ;;
  esac
  json="$out/$1.$2.json"
  data="$out/$3"
  shift 3
  [ -e "$json" ] || "$bin/supertac-evaluate" --model "$models" --threads 1 --json "$json" --data "$data" "$@"
}
for seed in $seeds; do
  for plate in $plates; do
    case ",$known," in
      *",$plate,"*) recorded=$known ;;
      *) recorded=$known,$plate ;;
    esac
    # shellcheck disable=SC2086 # a recipe is several words
    train "generalist_without_${plate}_s$seed" trial1 --split texture --leave-out "$plate" --seed "$seed" $recipe
    train "specialist_without_${plate}_s$seed" trial1 --split texture --leave-out "$plate" --seed "$seed" \
      --plates "$recorded" --preset tiny
    for kind in generalist specialist both; do
      score "${kind}_without_${plate}_s$seed" left_out trial1
      score "${kind}_without_${plate}_s$seed" alone alone --split none --plates "$plate"
    done
  done
  # shellcheck disable=SC2086
  train "generalist_s$seed" recordings --split trial --seed "$seed" $recipe
  train "specialist_s$seed" recordings --split trial --seed "$seed" --plates $known --preset tiny
  for kind in generalist specialist both; do
    score "${kind}_s$seed" trial recordings --plates $known
    score "${kind}_s$seed" alone alone --split none --plates $known
    score "${kind}_s$seed" never never --split none --plates ""
    score "${kind}_s$seed" plain plain --split none --plates ""
  done
done
python3 "$here/generalist.py" "$out" > "$out/generalist.csv"
