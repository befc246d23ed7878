"""Networks that saw simulated passes alone, and how real fingers differ from the simulated one."""
import itertools
import statistics

from .figures import rows, table


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


TABLES = [simulated_only, finger_fit]
