#!/usr/bin/env python3
"""The paper's Figure 7 shows super-resolved pictures. Here: twelve windows of each split, with input and truth beside.

    bench/paper/figure7.py --text TEXT_DIR | --simulated
"""
import shutil

from paper import PIXELS, SPLITS, Study, splits
from tables import over_seeds, rows, table


def figure7(folder="paper"):
    both = splits(rows(f"{folder}/figure7.csv"))
    return table(["16x16 pictures", "paper", "unseen trial", "`window`"], [
        ["SSIM", "0.81", *(over_seeds(of, "ssim") for of in both.values())],
        ["PSNR dB", "27.3", *(over_seeds(of, "psnr_db", 1) for of in both.values())]])


if __name__ == "__main__":
    study = Study(__doc__)
    study.keep_sweep("figure7", study.sweep("pixels", "paper", **PIXELS, scale=[4]))
    for split in SPLITS:
        shutil.copy(study.pictures(split) / "strips.png", study.kept / f"figure7_{split}.png")
    print(figure7(study.kept))
    print(f"pictures: {study.kept}/figure7_*.png")
