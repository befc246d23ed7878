"""The table of baselines.sh as CSV: baselines.py DIR reads DIR/baseline_<method>_s<seed>.json."""
import json
import pathlib
import sys

FIGURES = ["ssim", "psnr_mean_db", "position_error_mm"]


def row(method, seed, contact, whole):
    cells = [method, seed]
    for scores in (contact, whole):
        cells += [f"{scores[f]:.4f}" if scores and scores.get(f) is not None else "" for f in FIGURES]
    print(",".join(map(str, cells)))


print("method,seed," + ",".join(f"{part}_{f}" for part in ("contact", "all") for f in FIGURES))
simple = None
for path in sorted(pathlib.Path(sys.argv[1]).glob("baseline_*_s*.json")):
    method, seed = path.stem.removeprefix("baseline_").rsplit("_s", 1)
    scores = json.loads(path.read_text())
    if "contact" in scores:
        row(method, seed, scores["contact"], scores["all"])
        simple = simple or scores["baselines"]
    else:  # pairs: no contact is known, every picture counts
        row(method, seed, None, scores["all"]["network"])
for method, scores in (simple or {}).items():
    row(method, "", scores["contact"], scores["all"])
