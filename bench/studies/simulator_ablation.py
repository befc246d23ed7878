"""The table of simulator_ablation.sh as CSV: simulator_ablation.py DIR reads DIR/<simulator>_s<seed>.json. The gain is over
the whole simulator with the same seeds: what leaving the term out brings."""
import json
import pathlib
import sys

from summarise import mean_and_interval

runs = {}  # simulator -> {seed: scores in contact}
for path in sorted(pathlib.Path(sys.argv[1]).glob("*_s*.json")):
    name, seed = path.stem.rsplit("_s", 1)
    runs.setdefault(name, {})[int(seed)] = json.loads(path.read_text())["contact"]
print("simulator,seeds,contact_ssim,contact_ssim_ci95,contact_psnr_db,contact_psnr_db_ci95,position_error_mm,ssim_gain")
for name, by_seed in sorted(runs.items(), key=lambda item: item[0] != "whole"):
    figures = []
    for figure in ("ssim", "psnr_mean_db"):
        figures += mean_and_interval([scores[figure] for scores in by_seed.values()])
    figures.append(mean_and_interval([scores["position_error_mm"] for scores in by_seed.values()])[0])
    figures.append(sum(scores["ssim"] - runs["whole"][seed]["ssim"] for seed, scores in by_seed.items()) / len(by_seed))
    print(f"{name},{len(by_seed)}," + ",".join(f"{f:.4f}" for f in figures))
