"""Tests of significance on rows of a sweep (Debian: python3-scipy), which the paper asks for."""
import numpy as np
from scipy import stats


def by_seed(rows, figure):
    return {row["seed"]: float(row[figure]) for row in rows}


def paired(a, b, figure="ssim"):
    """The paired t-test over the seeds that both configurations have."""
    x, y = by_seed(a, figure), by_seed(b, figure)
    seeds = sorted(x.keys() & y.keys())
    difference = np.array([x[seed] - y[seed] for seed in seeds])
    p = f", p = {stats.ttest_1samp(difference, 0).pvalue:.2g}" if len(seeds) > 1 else ""
    return f"{figure} {difference.mean():+.4f} over {len(seeds)} seeds{p}"


def anova(rows, figure="ssim"):
    """Two-way analysis of variance over latent dimension and T; every cell must be full. The error is what seeds differ by
    within a cell; where there is one seed, it is what the two do together beyond their sum."""
    axes = [sorted({row[key] for row in rows}, key=int) for key in ("latent", "timesteps", "seed")]
    values = {(row["latent"], row["timesteps"], row["seed"]): float(row[figure]) for row in rows}
    cells = np.array([[[values[x, t, s] for s in axes[2]] for t in axes[1]] for x in axes[0]])
    a, b, n = cells.shape
    grand, latents, lengths, means = cells.mean(), cells.mean((1, 2)), cells.mean((0, 2)), cells.mean(2)
    within = ((cells - means[:, :, None]) ** 2).sum()
    interaction = means - latents[:, None] - lengths[None, :] + grand
    parts = [("LD", b * n * ((latents - grand) ** 2).sum(), a - 1), ("T", a * n * ((lengths - grand) ** 2).sum(), b - 1),
             ("LD and T together", n * (interaction**2).sum(), (a - 1) * (b - 1))]
    freedom = a * b * (n - 1)
    if n == 1:
        _, within, freedom = parts.pop()
    for source, squares, degrees in parts:
        f = squares / degrees / (within / freedom)
        yield {"source": source, "degrees": f"{degrees}, {freedom}", "f": f"{f:.4g}", "p": f"{stats.f.sf(f, degrees, freedom):.3g}"}
