#!/usr/bin/env python3
"""The paper's Figure 10 shows pictures along a slide. Here: a film of one test pass of each plate, and how far the
pictures stand beside the plate, which the paper gives as 0.8 pixels or 0.65 mm.

    bench/paper/figure10.py --text TEXT_DIR | --simulated
"""
import shutil

from paper import PIXELS, PLATES, SPLITS, Study, splits
from tables import over_seeds, rows, table


def figure10(folder="paper"):
    both = splits(rows(f"{folder}/figure10.csv"))
    return table(["16x16 pictures", "paper", "unseen trial", "`window`"],
                 [["position error, mm", "0.65", *(over_seeds(of, "position_mm", 2) for of in both.values())]])


if __name__ == "__main__":
    study = Study(__doc__)
    study.keep_sweep("figure10", study.sweep("pixels", "paper", **PIXELS, scale=[4]))
    for split in SPLITS:
        for plate in PLATES.split(","):
            film = sorted(study.pictures(split).glob(f"film_{plate}_*.png"))[0]
            shutil.copy(film, study.kept / f"figure10_{split}_{plate}.png")
    print(figure10(study.kept))
    print(f"films: {study.kept}/figure10_*.png")
