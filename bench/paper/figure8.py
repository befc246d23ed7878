#!/usr/bin/env python3
"""The paper's Figure 8: SSIM against the latent dimension LD, here as a heat map of LD and T, with an analysis of variance.

    bench/paper/figure8.py --text TEXT_DIR | --simulated

As in Table 1, networks have the size of `tiny` and are judged on frames with 512 samples of their pass behind them.
Needs gnuplot and python3-scipy.
"""
import pathlib
import subprocess

import table1
from paper import Study, splits
from tables import chosen, mean, over_seeds, rows, table

LATENTS = (3, 10, 30)


def figure8(folder="paper"):
    lines = []
    for latent in LATENTS:
        both = splits(chosen(rows(f"{folder}/figure8.csv"), latent=str(latent), timesteps="256"))
        lines.append([str(latent), *(over_seeds(of, "ssim") for of in both.values())])
    return table(["LD at T 256", "SSIM, unseen trial", "`window`"], lines)


def heat_map(found, png):
    cells = "".join(f"{j} {i} {mean(of, 'ssim'):.4f}\n" for i, latent in enumerate(LATENTS)
                    for j, length in enumerate(sorted(table1.LENGTHS))
                    if (of := chosen(found, latent=str(latent), timesteps=str(length))))
    script = pathlib.Path(__file__).with_name("heat_map.gp").read_text()
    names = lambda values: ", ".join(f'"{v}" {i}' for i, v in enumerate(values))
    program = (f"set output '{png.name}'\nset ytics ({names(LATENTS)})\nset xtics ({names(sorted(table1.LENGTHS))})\n"
               f"$cells << EOD\n{cells}EOD\n{script}")
    subprocess.run(["gnuplot"], cwd=png.parent, input=program, text=True, check=True)


if __name__ == "__main__":
    study = Study(__doc__, tests=True)
    found = study.sweep("grid", "tiny", **table1.GRID, latent=LATENTS)
    study.keep_sweep("figure8", found, "timesteps", "latent")
    for split, of in splits(found).items():
        heat_map(of, study.kept / f"figure8_{split}.png")
    print(figure8(study.kept))
    study.test("figure8")
    print(f"heat maps: {study.kept}/figure8_*.png")
