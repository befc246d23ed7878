"""Plates that were never felt."""
import itertools

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


def what_is_missing():
    """Contact SSIM as drawn, and were one thing known that no network could know."""
    found = rows("what_is_missing.csv")
    columns = ("as_drawn", "width", "place", "height", "all_three", "by_one_power", "one_power", "by_one_step", "one_step_mm")
    middle = lambda chosen, column: f"{mean([float(r[column]) for r in chosen]):.2f}"
    lines = []
    for network in dict.fromkeys(r["network"] for r in found):
        of = [r for r in found if r["network"] == network]
        for plate in dict.fromkeys(r["plate"] for r in of):
            lines.append([network, plate, *(middle([r for r in of if r["plate"] == plate], column) for column in columns)])
        lines.append([network, "mean of the four", *(middle(of, column) if "one_" not in column or "by" in column else "" for column in columns)])
    return table(["plate is", "plate", "as drawn", "were the widths of each picture known", "its place", "its heights", "all three",
                  "one width for the whole plate", "as a power", "one place for the whole plate", "mm"], lines)


def never_felt():
    return table(["tried", "random plates", "options", "left out", "contact SSIM", "contact PSNR dB", "ghosts on flat", "verdict"],
                 [[r["recipe"], r["random_plates"], f"`{r['options']}`", r["left_out"], r["contact_ssim"],
                   r["contact_psnr_db"], f"{100 * float(r['flat_ghost_rate']):.1f} %", r["verdict"]]
                  for r in rows("never_felt.csv")])


TABLES = [left_out, what_is_missing, never_felt]
