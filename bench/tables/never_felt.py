"""Plates that were never felt."""
import itertools
import statistics

from .figures import mean, over_seeds, rows, table


def left_out():
    share = lambda chosen, column: f"{100 * mean([float(r[column]) for r in chosen]):.1f} %"
    line = lambda name, seeds, chosen: [chosen[0]["fingers"], name, seeds, over_seeds(chosen, "contact_ssim", 3),
                                        over_seeds(chosen, "contact_psnr_db", 1), share(chosen, "miss_rate"),
                                        share(chosen, "flat_ghost_rate"), share(chosen, "coverage"),
                                        over_seeds(chosen, "copy_ssim", 3) if chosen[0].get("copy_ssim") else "",
                                        over_seeds(chosen, "trial2_ssim", 3) if chosen[0].get("trial2_ssim") else "",
                                        over_seeds(chosen, "specialist_ssim", 3) if chosen[0].get("specialist_ssim") else "",
                                        over_seeds(chosen, "both_ssim", 3) if chosen[0].get("both_ssim") else "",
                                        over_seeds(chosen, "both_trial2_ssim", 3) if chosen[0].get("both_trial2_ssim") else "",
                                        unfamiliar(chosen)]
    def unfamiliar(chosen):
        passes = [float(x) for r in chosen for x in r.get("unfamiliar_of_pass", "").split()]
        return f"{sum(x > 0.1 for x in passes)} of {len(passes)}" if passes else ""

    four = ("3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges")
    names = ("left_out", "seed", "fingers", "unfamiliar_of_pass")
    lines = []
    for fingers, group in itertools.groupby(rows("left_out.csv"), lambda r: r["fingers"]):
        found = list(group)
        for plate in dict.fromkeys(r["left_out"] for r in found):
            chosen = [r for r in found if r["left_out"] == plate]
            lines.append(line(plate, ", ".join(r["seed"] for r in chosen), chosen))
        means = [{column: mean([float(r[column]) for r in found if r["seed"] == seed and r["left_out"] in four])
                  for column in found[0] if column not in names and found[0][column]} | {"seed": seed, "fingers": fingers}
                 for seed in dict.fromkeys(r["seed"] for r in found)
                 if sum(r["seed"] == seed and r["left_out"] in four for r in found) == 4]
        lines.append(line("mean of the four", ", ".join(r["seed"] for r in means), means))
        lines[-1][-1] = unfamiliar(found)
        simulated = [{column.replace("random_", "contact_" if "ssim" in column or "psnr" in column else "flat_" if "ghost" in column else ""): value
                      for column, value in r.items() if column.startswith("random_")} | {"fingers": fingers} for r in found]
        lines.append(line("simulated plates that no training draws", f"{len(found)} networks", simulated))
    return table(["fingers of the random passes", "plate that was left out", "seeds", "contact SSIM", "PSNR dB", "misses", "ghosts on flat",
                  "intervals hold", "SSIM on a simulated copy of it", "on trial 2 imported on its own", "a specialist's SSIM",
                  "both together", "both on trial 2", "passes called unfamiliar"], lines)


def never_felt():
    return table(["tried", "random plates", "options", "left out", "contact SSIM", "contact PSNR dB", "ghosts on flat", "verdict"],
                 [[r["recipe"], r["random_plates"], f"`{r['options']}`", r["left_out"], r["contact_ssim"],
                   r["contact_psnr_db"], f"{100 * float(r['flat_ghost_rate']):.1f} %", r["verdict"]]
                  for r in rows("never_felt.csv")])


def simulated_only():
    found = rows("simulated_only.csv")
    plates = ["3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges", "4_Blob", "6_Blob"]
    return table(["random passes", "plates", "epochs", "seed", *plates, "mean of the first four", "PSNR dB", "ghosts on flat"],
                 [[r["random_passes"], r["random_plates"], r["epochs"], r["seed"], *(r[plate] for plate in plates),
                   r["mean_of_four"], r["mean_psnr_db"], f"{100 * float(r['mean_flat_ghost_rate']):.0f} %"] for r in found])


def finger_fit():
    lines = []
    where = lambda r: (f"trial {r['trial']}" if r["source"] == "imported" else r["source"], r["plate"])
    for (source, plate), group in itertools.groupby(rows("finger_fit.csv"), where):
        fitted = [r for r in group if r["pass"] not in "18" and float(r["explained"]) >= 0.6]
        middle = lambda key: f"{statistics.median(float(r[key]) for r in fitted):.2f}" if fitted and fitted[0][key] else ""
        lines.append([source, plate, str(len(fitted)), *(middle(key) for key in list(fitted[0])[4:])])
    return table(["of", "plate", "passes", "explained", "indentation mm", "tilt across", "tilt along", "rise mm in 50 mm",
                  "offset mm", "peaks mm wide"], lines)


TABLES = [left_out, never_felt, simulated_only, finger_fit]
