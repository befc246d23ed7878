#!/usr/bin/env python3
"""The paper's Table 2: pictures of 8x8, 16x16 and 32x32 pixels, at T 256 and LD 10.

    bench/paper/table2.py --text TEXT_DIR | --simulated
"""
from paper import PIXELS, Study, significance_table, splits
from tables import chosen, over_seeds, rows, table

SIZES = {2: (0.77, 24.02), 4: (0.81, 27.3), 8: (0.74, 23.09)}


def table2(folder="paper"):
    lines = []
    for scale, (ssim, psnr) in SIZES.items():
        both = splits(chosen(rows(f"{folder}/table2.csv"), scale=str(scale)))
        lines.append([f"{4 * scale}x{4 * scale}", f"{ssim:.2f}", *(over_seeds(of, "ssim") for of in both.values()), f"{psnr:.1f}",
                      *(over_seeds(of, "psnr_db", 1) for of in both.values())])
    return table(["pixels", "SSIM, paper", "unseen trial", "`window`", "PSNR dB, paper", "unseen trial", "`window`"], lines)


def table2_tests(folder="paper"):
    return significance_table("table2", folder)


if __name__ == "__main__":
    study = Study(__doc__, tests=True)
    study.keep_sweep("table2", study.sweep("pixels", "paper", **PIXELS, scale=SIZES), "scale")
    print(table2(study.kept))
    study.test("table2")
