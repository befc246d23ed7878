#!/usr/bin/env python3
"""The paper's Table 1: what the length of the window, T samples, does to SSIM, phase correlation and speed, at LD 10.

    bench/paper/table1.py --text TEXT_DIR | --simulated

The network has the size of preset `tiny`. All lengths are judged on the same frames: those with 512 samples of their pass
behind them, which the longest needs.
"""
from paper import Study, significance_table, splits
from tables import chosen, mean, over_seeds, rows, table

LENGTHS = {512: (0.84, 88.76, 48.89), 256: (0.80, 94.32, 50.79), 128: (0.76, 93.32, 51.24), 64: (0.70, 86.27, 51.83),
           32: (0.70, 85.38, 52.76)}
GRID = {"history": 512, "timesteps": sorted(LENGTHS)}


def table1(folder="paper"):
    lines = []
    for length, (ssim, phase, pace) in LENGTHS.items():
        both = splits(chosen(rows(f"{folder}/table1.csv"), timesteps=str(length)))
        lines.append([str(length), f"{ssim:.2f}", *(over_seeds(of, "ssim") for of in both.values()), f"{phase / 100:.3f}",
                      *(f"{mean(of, 'phase'):.3f} ({mean(of, 'phase_floor'):.3f})" for of in both.values()), f"{pace:.0f}",
                      f"{1e6 / mean(both['trial'], 'median_us'):,.0f}"])
    return table(["T", "SSIM, paper", "unseen trial", "`window`", "phase correlation, paper", "unseen trial (floor)",
                  "`window` (floor)", "pictures a second, paper", "ours"], lines)


def table1_tests(folder="paper"):
    return significance_table("table1", folder)


if __name__ == "__main__":
    study = Study(__doc__, tests=True)
    study.keep_sweep("table1", study.sweep("grid", "tiny", **GRID, latent=[10]), "timesteps")
    print(table1(study.kept))
    study.test("table1")
