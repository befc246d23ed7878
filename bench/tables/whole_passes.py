"""Whole passes, silence, corruptions, unknown kinds of plates, and the demo."""
import itertools

from .figures import mean, over_seeds, rows, table


NETWORKS = {"four of paper averaged (muon; plain autoencoder; all but the seed)": "`best`: four of `paper`, plain, Muon",
            "four of paper (muon; plain autoencoder; all but the seed) beside a generalist of 1500 random plates":
                "the same beside a generalist",
            "preset paper (muon; plain autoencoder)": "`paper`, plain, Muon", "variational, muon": "`paper`, Muon",
            "preset paper": "`paper`, as in the paper",
            "preset tiny": "`tiny`", "ridge regression": "ridge regression", "mean image": "mean image", "bicubic": "bicubic"}


def reached():
    """The headline: the networks that a user would take, on the unseen trial and on the same imported on its own."""
    lines = []
    found = rows("whole_passes.csv") + [r | {"network": "variational, " + r["optimizer"]} for r in rows("optimizers.csv")
                                        if r["training"] == "preset paper"]
    for network, name in NETWORKS.items():
        unseen, alone = ([r for r in found if (r["network"], r["windows_of"]) == (network, windows_of)]
                         for windows_of in ("trial 2", "trial 2 imported on its own"))
        lines.append([name, over_seeds(unseen, "contact_ssim", 3), over_seeds(unseen, "contact_psnr_db", 1),
                      f"{mean([float(r['position_error_mm']) for r in unseen]):.2f}" if "position_error_mm" in unseen[0] else "",
                      f"{100 * mean([float(r['flat_ghost_rate']) for r in unseen]):.1f} %",
                      over_seeds(alone, "contact_ssim", 3), over_seeds(alone, "contact_psnr_db", 1)])
    return table(["network", "contact SSIM", "PSNR dB", "position error mm", "ghosts on flat", "imported on its own: SSIM", "PSNR dB"], lines)


def whole_passes():
    lines = []
    for (network, windows_of), group in itertools.groupby(rows("whole_passes.csv"), lambda r: (r["network"], r["windows_of"])):
        chosen = list(group)
        middle = lambda column: mean([float(r[column]) for r in chosen])
        percent = lambda column: f"{100 * middle(column):.1f} %"
        lines.append([network, windows_of, ", ".join(r["seed"] for r in chosen), over_seeds(chosen, "contact_ssim", 3),
                      over_seeds(chosen, "contact_psnr_db", 1), f"{middle('position_error_mm'):.2f}", percent("miss_rate"),
                      percent("flat_ghost_rate")])
        lines[-1] += [percent("coverage"), f"{middle('sure_ssim'):.3f}", f"{middle('auroc'):.2f}",
                      f"{middle('spread_near') / middle('spread_far'):.2f}"] if chosen[0]["coverage"] else [""] * 4
    return table(["network", "windows of", "seeds", "contact SSIM", "PSNR dB", "position mm", "misses", "ghosts on flat", "intervals hold",
                  "SSIM of the surest 80 %", "AUROC of SSIM below .8", "spread at 0 to 15 mm / beyond 30"], lines)


def silent_signals():
    found = rows("audit/silent_signals.csv")
    strengths = [("constant", "0"), *(("noisy", s) for s in ("0.003", "0.01", "0.02", "0.04")),
                 *(("drifting", s) for s in ("0.003", "0.02", "0.05", "0.1"))]
    lines = []
    for network in dict.fromkeys((r["network"], r["silence_shown"]) for r in found):
        chosen = [r for r in found if (r["network"], r["silence_shown"]) == network]
        ghosts = lambda signals, strength: mean([float(r["ghost_rate"]) for r in chosen
                                                 if (r["signals"], r["strength"]) == (signals, strength)])
        lines.append([f"{network[0]}, {network[1]}", ", ".join(dict.fromkeys(r["seed"] for r in chosen)),
                      *(f"{100 * ghosts(*strength):.1f} %" for strength in strengths)])
    return table(["network, silence shown in training", "seeds", "constant", *(f"noise {s}" for k, s in strengths if k == "noisy"),
                  *(f"drift {s}" for k, s in strengths if k == "drifting")], lines)


def corruptions():
    found = {key: list(group) for key, group in itertools.groupby(
        sorted(rows("corruptions.csv"), key=lambda r: (r["model"], r["corruption"], r["severity"])),
        lambda r: (r["model"], r["corruption"], r["severity"]))}
    middle = lambda model, name, severity, column: mean([float(r[column]) for r in found[model, name, severity]])
    lines = []
    for name in dict.fromkeys(r["corruption"] for r in rows("corruptions.csv") if r["corruption"] != "none"):
        lines.append([name] + [f"{middle('paper', name, s, 'ssim'):.3f}" for s in "135"] +
                     [f"{middle(model, name, '3', 'ssim'):.3f}" for model in ("tiny", "best", "generalist")] +
                     [f"{100 * middle(model, name, '3', 'coverage'):.0f} %" for model in ("paper", "tiny", "best", "generalist")] +
                     [f"{middle('paper', name, s, 'alarm_auroc'):.3f}" for s in "135"] +
                     [f"{100 * middle('paper', name, '3', 'alarms'):.0f} %"])
    return table(["corruption", "contact SSIM of `paper` at 1", "at 3", "at 5", "of `tiny` at 3", "`best` at 3", "generalist at 3",
                  "intervals of `paper` hold at 3", "`tiny`", "`best`", "generalist", "alarm's AUROC for `paper` at 1", "at 3", "at 5",
                  "alarms at 3"], lines)


def unknown_plates():
    lines = []
    found = rows("unknown_plates.csv")
    for way in dict.fromkeys(r["way"] for r in found):
        lines.append([way] + [over_seeds([r for r in found if (r["way"], r["plate"]) == (way, plate) and r["model"].startswith("paper")],
                                         "auroc", 2) for plate in ("4_Waves", "6_Waves", "4_Blob", "6_Blob")])
    return table(["what a network could go by", "4_Waves", "6_Waves", "4_Blob", "6_Blob"], lines)


def demo():
    return table(["windows of", "method", "contact SSIM", "PSNR dB", "position mm", "misses", "ghosts: flat", "air", "all SSIM",
                  "PSNR dB"],
                 [[v if not k.endswith("_rate") or not v else f"{100 * float(v):.1f} %" for k, v in r.items()]
                  for r in rows("demo.csv")])


TABLES = [reached, whole_passes, silent_signals, corruptions, unknown_plates, demo]
