"""Where training works, and optimizers."""
import itertools

from .figures import mean, over_seeds, rows, table


def stability():
    counts = {}
    for r in rows("stability_map.csv"):
        key = r["safeguards"], r["outcome"]
        counts[key] = [counts.get(key, [0, 0])[0] + 1, counts.get(key, [0, 0])[1] + (r["warned"] == "yes")]
    outcomes = ["trained", "slow", "collapsed", "diverged", "stopped"]
    return table(["clipping and warm-up"] + outcomes,
                 [[side] + [f"{n} ({w} warned)" if n else "0" for n, w in (counts.get((side, o), (0, 0)) for o in outcomes)]
                  for side in ("on", "off")])


def optimizers():
    lines = []
    for key, group in itertools.groupby(rows("optimizers.csv"), lambda r: (r["training"], r["windows_of"], r["optimizer"])):
        chosen = list(group)
        lines.append([*key[:2], ", ".join(r["seed"] for r in chosen), chosen[0]["steps"], key[2], over_seeds(chosen, "contact_ssim", 3),
                      over_seeds(chosen, "contact_psnr_db", 1), f"{100 * mean([float(r['flat_ghost_rate']) for r in chosen]):.1f} %"])
    return table(["training", "windows of", "seeds", "steps", "optimizer", "contact SSIM", "PSNR dB", "ghosts on flat"], lines)


TABLES = [stability, optimizers]
