#!/usr/bin/env python3
"""The scores that generalist.sh left in a folder, one line for each network and each set of windows, as CSV.

    generalist.py OUT_DIR > generalist.csv
"""
import json
import pathlib
import sys

COLUMNS = [("contact", "ssim"), ("contact", "psnr_mean_db"), ("contact", "miss_rate"), ("flat", "ghost_rate"),
           ("air", "ghost_rate"), ("trust", "coverage"), ("trust", "factor_found"), ("trust", "sure_ssim"),
           ("trust", "auroc"), ("trust", "unlike_training"), ("trust", "unfamiliar")]


def cell(value):
    return "" if value is None else f"{value:.4f}"


def main(folder):
    print("network,seed,windows_of," + ",".join(f"{part}_{key}" for part, key in COLUMNS))
    for path in sorted(pathlib.Path(folder).glob("*.*.json")):
        name, what = path.name[:-len(".json")].rsplit(".", 1)
        network, seed = name.rsplit("_s", 1)
        scores = json.loads(path.read_text())
        print(network, seed, what, *(cell(scores.get(part, {}).get(key)) for part, key in COLUMNS), sep=",")


if __name__ == "__main__":
    main(sys.argv[1])
