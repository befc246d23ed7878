"""Means and 95 % intervals (Student's t) over seeds: summarise.py DIR reads DIR/<split>_s<seed>.json, prints CSV."""
import json
import math
import pathlib
import sys

T_975 = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}
FIGURES = ["ssim", "psnr_mean_db", "psnr_pooled_db", "phase_correlation", "phase_correlation_floor",
           "position_error_px", "position_error_mm"]

runs = {}
for path in sorted(pathlib.Path(sys.argv[1]).glob("*_s*.json")):
    split, seed = path.stem.rsplit("_s", 1)
    runs.setdefault(split, []).append((int(seed), json.loads(path.read_text())))

print("split,part,method,seeds,windows," + ",".join(f"{f},{f}_ci95" for f in FIGURES) + ",lowest_ssim")
for split, results in runs.items():
    for part in ("contact", "all"):
        for method in ("network", *results[0][1]["baselines"]):
            scores = [(r if method == "network" else r["baselines"][method])[part] for _, r in results]
            row = [split, part, method, len(scores), scores[0]["windows"]]
            for figure in FIGURES:
                values = [s[figure] for s in scores]
                mean = sum(values) / len(values)
                spread = math.sqrt(sum((v - mean) ** 2 for v in values) / max(1, len(values) - 1))
                row += [f"{mean:.4f}", f"{T_975.get(len(values) - 1, 0) * spread / math.sqrt(len(values)):.4f}"]
            row.append(f"{min(s['ssim'] for s in scores):.4f}")
            print(",".join(str(x) for x in row))
