"""Means and 95 % intervals (Student's t) over seeds: summarise.py DIR reads DIR/<run>_s<seed>.json of real_recordings.sh,
prints CSV (Debian: python3-scipy)."""
import json
import pathlib
import sys

import numpy as np
from scipy import stats

RUNS = ["best", "tiny", "trial", "window"]
FIGURES = ["ssim", "psnr_mean_db", "psnr_pooled_db", "phase_correlation", "phase_correlation_floor",
           "position_error_px", "position_error_mm"]


def mean_and_interval(values):
    """The mean and half its 95 % interval, 0 for a single value."""
    half = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values) if len(values) > 1 else 0.0
    return float(np.mean(values)), float(half)


def main():
    print("split,part,method,seeds,windows," + ",".join(f"{f},{f}_ci95" for f in FIGURES) + ",lowest_ssim")
    for run in RUNS:
        results = [json.loads(path.read_text()) for path in sorted(pathlib.Path(sys.argv[1]).glob(f"{run}_s*.json"))]
        for part in ("contact", "all") if results else ():
            for method in ("network", *results[0]["baselines"]):
                scores = [(r if method == "network" else r["baselines"][method])[part] for r in results]
                row = [run, part, method, len(scores), scores[0]["windows"]]
                for figure in FIGURES:
                    row += [f"{x:.4f}" for x in mean_and_interval([s[figure] for s in scores])]
                row.append(f"{min(s['ssim'] for s in scores):.4f}")
                print(",".join(str(x) for x in row))


if __name__ == "__main__":
    main()
