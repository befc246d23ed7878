#!/usr/bin/python3
"""Statistics of a sweep's CSV over its seeds (Debian: python3-scipy).

    bench/studies/sweep_statistics.py SWEEP.csv [--figure ssim] [--compare CONFIGURATION_A CONFIGURATION_B]

Prints for each configuration the mean with its 95 % interval (Student's t); with --compare the paired t-test and the
Wilcoxon signed-rank test over the seeds both have; and, when every latent size has been run with every T (all else
equal) on the same seeds, a two-way analysis of variance over latent, T and their interaction.
"""
import argparse
import csv
import itertools
import sys

import numpy as np
from scipy import stats


def read(path, figure):
    """configuration -> {seed: value}, configuration -> its row"""
    values, rows = {}, {}
    with open(path, newline="") as file:
        for row in csv.DictReader(file):
            if figure not in row:
                sys.exit(f"sweep_statistics.py: {path}: no column {figure}; it has {', '.join(row)}")
            name = row["model"].rsplit("_s", 1)[0]
            values.setdefault(name, {})[int(row["seed"])] = float(row[figure])
            rows[name] = row
    return values, rows


def print_means(values, figure):
    print(f"configuration,seeds,{figure},ci95,lowest,highest")
    for name, by_seed in values.items():
        v = np.array(list(by_seed.values()))
        half = stats.t.ppf(0.975, len(v) - 1) * stats.sem(v) if len(v) > 1 else float("nan")
        print(f"{name},{len(v)},{v.mean():.4f},{half:.4f},{v.min():.4f},{v.max():.4f}")


def compare(values, a, b):
    for name in (a, b):
        if name not in values:
            sys.exit(f"sweep_statistics.py: no configuration {name}; there are {', '.join(values)}")
    seeds = sorted(values[a].keys() & values[b].keys())
    x, y = (np.array([values[name][seed] for seed in seeds]) for name in (a, b))
    if len(seeds) < 2:
        sys.exit(f"sweep_statistics.py: {a} and {b} have {len(seeds)} seeds in common; a paired test needs two or more")
    print(f"\n{a} - {b} over {len(seeds)} seeds: mean {np.mean(x - y):+.4f}")
    print(f"  paired t-test          p = {stats.ttest_rel(x, y).pvalue:.4g}")
    if np.any(x != y):
        # With n seeds no p below 2^(1-n) is possible.
        print(f"  Wilcoxon signed rank   p = {stats.wilcoxon(x, y).pvalue:.4g} (at least {2.0 ** (1 - len(seeds)):.4g})")


def anova(cells):
    """cells [latents][timesteps][seeds]: sums of squares of a balanced two-way layout with replication."""
    a, b, n = cells.shape
    grand, rows, columns, means = cells.mean(), cells.mean((1, 2)), cells.mean((0, 2)), cells.mean(2)
    error = ((cells - means[:, :, None]) ** 2).sum()
    interaction = means - rows[:, None] - columns[None, :] + grand
    parts = [("latent", b * n * ((rows - grand) ** 2).sum(), a - 1), ("timesteps", a * n * ((columns - grand) ** 2).sum(), b - 1),
             ("latent x timesteps", n * (interaction**2).sum(), (a - 1) * (b - 1))]
    degrees = a * b * (n - 1)
    print(f"\nanalysis of variance: {a} latent sizes x {b} window lengths x {n} seeds")
    print(f"  {'':20} {'sum sq':>10} {'df':>4} {'F':>9} {'p':>10}")
    for name, squares, freedom in parts:
        f = squares / freedom / (error / degrees)
        print(f"  {name:20} {squares:10.4g} {freedom:4d} {f:9.2f} {stats.f.sf(f, freedom, degrees):10.3g}")
    print(f"  {'within':20} {error:10.4g} {degrees:4d}")


def anovas(values, rows):
    """One for each group of configurations that differ in latent and T only and are complete."""
    def others(row):
        return row["preset"], row["scale"], row["channels"], row["rcabs"]

    for _, names in itertools.groupby(sorted(values, key=lambda name: others(rows[name])), lambda name: others(rows[name])):
        cells = {(int(rows[name]["latent"]), int(rows[name]["timesteps"])): values[name] for name in names}
        latents, lengths = (sorted({key[i] for key in cells}) for i in (0, 1))
        seeds = set.intersection(*(set(v) for v in cells.values()))
        if min(len(latents), len(lengths), len(seeds)) < 2 or len(cells) < len(latents) * len(lengths):
            continue
        anova(np.array([[[cells[x, t][s] for s in sorted(seeds)] for t in lengths] for x in latents]))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("csv")
    parser.add_argument("--figure", default="ssim", help="a column of the table")
    parser.add_argument("--compare", nargs=2, metavar="CONFIGURATION")
    options = parser.parse_args()
    values, rows = read(options.csv, options.figure)
    print_means(values, options.figure)
    if options.compare:
        compare(values, *options.compare)
    anovas(values, rows)


if __name__ == "__main__":
    main()
