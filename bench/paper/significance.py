#!/usr/bin/env python3
"""Tests of significance on the CSV of an item, which the paper asks for (Debian: python3-scipy).

    bench/paper/significance.py bench/results/paper/table2.csv     writes table2_tests.csv beside it

Over the seeds: a paired t-test of each setting against the next; where LD and T were varied together, a two-way analysis
of variance.
"""
import csv
import pathlib
import sys

import numpy as np
from scipy import stats

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import source  # noqa: E402

SETTINGS = {"scale": "scale", "timesteps": "T", "latent": "LD"}


def paired(a, b):
    """Two configurations' values by seed."""
    seeds = sorted(a.keys() & b.keys())
    difference = np.array([a[seed] - b[seed] for seed in seeds])
    result = stats.ttest_1samp(difference, 0)
    return {"test": "paired t-test", "difference": f"{difference.mean():+.4f}", "seeds": len(seeds),
            "statistic": f"{result.statistic:.3g}", "p": f"{result.pvalue:.2g}"}


def anova(values):
    """values [latents][timesteps][seeds]: sums of squares of a balanced two-way layout with replication."""
    a, b, n = values.shape
    grand, latents, lengths, means = values.mean(), values.mean((1, 2)), values.mean((0, 2)), values.mean(2)
    freedom = a * b * (n - 1)
    within = ((values - means[:, :, None]) ** 2).sum() / freedom
    interaction = means - latents[:, None] - lengths[None, :] + grand
    for source_of, squares, degrees in (("LD", b * n * ((latents - grand) ** 2).sum(), a - 1),
                                        ("T", a * n * ((lengths - grand) ** 2).sum(), b - 1),
                                        ("LD and T together", n * (interaction**2).sum(), (a - 1) * (b - 1))):
        f = squares / degrees / within
        yield {"compared": source_of, "test": "analysis of variance", "difference": "", "seeds": n, "statistic": f"{f:.3g}",
               "p": f"{stats.f.sf(f, degrees, freedom):.2g}"}


def tests_of(rows, figure="ssim"):
    """One line for each test that the rows, of one split, have seeds for."""
    varied = [key for key in SETTINGS if len({row.get(key) for row in rows}) > 1]
    values = {}
    for row in rows:
        values.setdefault(tuple(int(row[key]) for key in varied), {})[row["seed"]] = float(row[figure])
    order = sorted(values)
    if len(varied) == 1:
        for one, other in zip(order, order[1:]):
            if len(values[one].keys() & values[other].keys()) > 1:
                yield {"compared": f"{SETTINGS[varied[0]]} {other[0]} against {one[0]}", **paired(values[other], values[one])}
    if len(varied) == 2:
        axes = [sorted({key[i] for key in order}) for i in (1, 0)]  # LD, T
        seeds = set.intersection(*(set(v) for v in values.values()))
        if len(order) == len(axes[0]) * len(axes[1]) and len(seeds) > 1:
            yield from anova(np.array([[[values[t, x][s] for s in sorted(seeds)] for t in axes[1]] for x in axes[0]]))


def write(path):
    """PATH_tests.csv; nothing where no test has two seeds. Returns its lines."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    splits = dict.fromkeys(row["split"] for row in rows)
    lines = [{"split": split} | line for split in splits for line in tests_of([r for r in rows if r["split"] == split])]
    if lines:
        source.write(path.with_name(path.stem + "_tests.csv"), lines)
    return lines


if __name__ == "__main__":
    for name in sys.argv[1:] or sys.exit(__doc__):
        for found in write(pathlib.Path(name)):
            print(*found.values(), sep=", ")
