#!/usr/bin/env python3
"""The paper's Figure 11: textures told apart from raw 4x4 frames and from super-resolved 16x16 pictures.

    bench/paper/figure11.py --text TEXT_DIR | --simulated

A classifier for each seed and kind of input learns from the training windows in contact and is tested on those of the test.
"""
import json

from paper import PIXELS, SPLITS, Study
from tables import chosen, rows, table

VIEWS = {"frame": ("last 4x4 frame", "76.3"), "latents": ("latents", ""), "super_resolved": ("super-resolved 16x16", "93.1")}


def figure11(folder="paper"):
    found, lines = rows(f"{folder}/figure11.csv"), []
    for view, (name, paper) in VIEWS.items():
        cells = [chosen(found, split=split, view=view, part=part)[0] for split in SPLITS for part in ("contact", "inside")]
        lines.append([name, paper] + [f"{100 * float(c['accuracy']):.1f} ({100 * float(c['passes_ci95_low']):.0f} to "
                                      f"{100 * float(c['passes_ci95_high']):.0f})" for c in cells])
    return table(["what the classifier sees", "paper, %", "unseen trial: contact, %", "inside, %", "`window`: contact, %",
                  "inside, %"], lines)


def lines_of(split, result):
    for view, parts in result["views"].items():
        for part, r in parts.items():
            low, high = r["ci95_passes"]
            yield {"split": split, "view": view, "part": part, "windows": r["windows"], "test_passes": r["passes"],
                   "runs": result["runs"], "accuracy": f"{r['accuracy']:.4f}", "passes_ci95_low": f"{low:.4f}",
                   "passes_ci95_high": f"{high:.4f}",
                   "p_against_frame": f"{r['p_against_frame']:.5f}" if "p_against_frame" in r else ""}


if __name__ == "__main__":
    study, lines = Study(__doc__), []
    study.sweep("pixels", "paper", **PIXELS, scale=[4])
    for split in SPLITS:
        out = study.out / f"classify_{split}_{'-'.join(study.seeds)}.json"
        if not out.exists():
            study.run("classify", "--model", ",".join(map(str, study.models(split))), "--data", study.data, "--seeds",
                      len(study.seeds), "--threads", 1, "--json", out,
                      *(["--epochs", 1, "--stride", 8] if study.simulated else []))
        lines += lines_of(split, json.loads(out.read_text()))
    study.keep("figure11", lines)
    print(figure11(study.kept))
