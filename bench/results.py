#!/usr/bin/env python3
"""Writes the tables of bench/results/README.md from the CSV files beside it, and the README's from that page.

    bench/results.py            rewrites what stands between <!-- NAME --> and <!-- /NAME -->
    bench/results.py --check    changes nothing; exit code 1 and one line for everything that is stale

bench/results/sources.csv says of every file how it was made; a file that it does not name is an error. The README's
tables are those of the page with some lines left out.
"""
import itertools
import pathlib
import re
import statistics
import sys

from result_tables import RESULTS, line_through, mean, over_seeds, plus_minus, rows, table

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE, README = RESULTS / "README.md", ROOT / "README.md"


def sources():
    found = rows("sources.csv")
    return table(["file", "command", "commit", "split", "seeds", "date"],
                 [[f"`{r['file']}`", r["command"], r["commit"], r["split"], r["seeds"], r["date"]] for r in found])


RUNS = {"trial": "`trial`, preset `paper`", "best": "`trial`, `best`: four of `paper` averaged", "tiny": "`trial`, preset `tiny`",
        "window": "`window`, preset `paper`"}
METHODS = {"network": "", "ridge": "ridge regression", "bicubic": "bicubic", "nearest": "nearest", "mean_image": "mean image"}


def accuracy():
    found = {(r["split"], r["method"], r["part"]): r for r in rows("real_recordings.csv")}
    lines = []
    for run, method in itertools.product(RUNS, METHODS):
        if (method == "network" or run == "trial") and (run, method, "contact") in found:
            contact, every = found[run, method, "contact"], found[run, method, "all"]
            lines.append([RUNS[run] if method == "network" else METHODS[method]] + [
                plus_minus(row[figure], row[figure + "_ci95"], digits)
                for row, figure, digits in ((contact, "ssim", 3), (contact, "psnr_mean_db", 1), (every, "ssim", 3),
                                            (every, "psnr_mean_db", 1), (contact, "position_error_mm", 2))])
    return table(["split and method", "contact SSIM", "contact PSNR dB", "all SSIM", "all PSNR dB", "position error mm"], lines)


def phase():
    lines = []
    for r in rows("real_recordings.csv"):
        if r["part"] == "contact" and r["split"] == "trial":
            lines.append([METHODS[r["method"]] or "preset `paper`", plus_minus(r["phase_correlation"], r["phase_correlation_ci95"], 3),
                          plus_minus(r["phase_correlation_floor"], r["phase_correlation_floor_ci95"], 3),
                          plus_minus(r["psnr_pooled_db"], r["psnr_pooled_db_ci95"], 1)])
    return table(["method", "phase correlation", "its floor: the pictures shuffled", "PSNR of the pooled error, dB"], lines)


def imported():
    found = rows("import.csv")
    moved = sorted(abs(float(r["aligned_by_mm"])) for r in found if r["aligned_by_mm"])
    return table(["imported", ""], [
        ["passes, and those that fit their plate", f"{len(found)}, {sum(r['reliable'] == 'yes' for r in found)}"],
        ["mean residual of a contact", f"{mean([float(r['residual_mm']) for r in found]):.2f} mm"],
        ["passes aligned with others of their plate", f"{len(moved)}, by {moved[len(moved) // 2]:.2f} mm (median), at most {moved[-1]:.2f} mm"],
        ["passes with a further loss found by alignment", f"{sum(bool(r['further_loss_s']) for r in found)}"]])


def history():
    return table(["what was added", "commit", "contact SSIM", "contact PSNR dB"],
                 [[r["step"], r["commit"], plus_minus(r["contact_ssim"], r["contact_ssim_ci95"], 3),
                   plus_minus(r["contact_psnr_db"], r["contact_psnr_db_ci95"], 1)] for r in rows("history.csv")])


def parts():
    """What V, SSIM term, lifting, levelling, alignment and resolution of the array's network buy, each as with against without."""
    named = {r["method"]: r for r in rows("baselines.csv")}
    steps = {r["step"].split()[0]: r for r in rows("history.csv")}
    ideas = {key: list(group) for key, group in itertools.groupby(rows("generalisation.csv"), lambda r: r["idea"])}

    def of(row):
        return (f"{plus_minus(row['contact_ssim'], row['contact_ssim_ci95'], 3)}, "
                f"{plus_minus(row['contact_psnr_db'], row['contact_psnr_db_ci95'], 1)} dB")

    def idea(name, seeds=("0",)):
        chosen = [r for r in ideas[name] if r["seed"] in seeds]
        return f"{over_seeds(chosen, 'contact_ssim', 3)}, {over_seeds(chosen, 'contact_psnr_db', 1)} dB"

    plain = named["paper, plain autoencoder"]
    lines = [
        ["V of VAE: latent numbers drawn around their mean, KLD", of(named["paper"]), of(plain), "nothing", "`baselines.csv`, five seeds"],
        ["a window of time instead of one frame, same blocks", of(named["paper"]), of(named["one frame, our blocks"]),
         f"{float(named['paper']['contact_ssim']) - float(named['one frame, our blocks']['contact_ssim']):+.3f}", "`baselines.csv`, five seeds"],
    ]
    lines.append(["transposed convolution instead of sub-pixel (which has left the core)", of(named["paper"]), of(named["paper, sub-pixel"]),
                  f"nothing; sub-pixel takes {100 * (float(named['paper, sub-pixel']['median_us']) / float(named['paper']['median_us']) - 1):.0f} % longer",
                  "`baselines.csv`, five seeds"])
    if "lifted; no SSIM term" in ideas:
        lines.append(["SSIM term of the loss, lambda .1 against 0", idea("lifted; lambda 0.1"), idea("lifted; no SSIM term"), "see text",
                      "`generalisation.csv`, seed 0"])
    lines += [
        ["SSIM term, lambda .1 against .3", idea("lifted by up to 0.4"), idea("lifted; lambda 0.3"), "a heavier term costs .4 dB",
         "`generalisation.csv`, seed 0"],
        ["lifting the finger in augmentation", of(steps["the"]), of(steps["windows"]), "", "`history.csv`, five seeds"],
        ["levelling, beside lifting", idea("lifted by up to 0.4"), idea("lifted; scaled alike"),
         "nothing in contact; 1.0 dB over all frames", "`generalisation.csv`, seed 0"],
        ["clocks restored", of(steps["clocks"]), of(steps["the"]), "", "`history.csv`, five seeds"],
        ["passes aligned", of(steps["passes"]), of(steps["clocks"]), "", "`history.csv`, five seeds"],
        ["losses without a step found and filled", of(steps["losses"]), of(steps["passes"]), "", "`history.csv`, five seeds"],
    ]
    for line in lines:
        if not line[3]:
            line[3] = f"{float(line[1].split()[0]) - float(line[2].split()[0]):+.3f}"
    return table(["part", "with", "without", "what it buys", "from"], lines)


def baselines():
    return table(["method", "contact SSIM", "contact PSNR dB", "all SSIM", "all PSNR dB", "time of a picture", "seeds"],
                 [[r["method"], plus_minus(r["contact_ssim"], r["contact_ssim_ci95"], 3),
                   plus_minus(r["contact_psnr_db"], r["contact_psnr_db_ci95"], 1), f"{float(r['all_ssim']):.3f}",
                   f"{float(r['all_psnr_db']):.1f}", f"{float(r['median_us']):.1f} us", r["seeds"]] for r in rows("baselines.csv")])


TASKS = {"infer 1": "inference, batch 1", "infer 8": "inference, batch 8", "infer 64": "inference, batch 64",
         "int8 1": "in int8, batch 1", "int8 8": "in int8, batch 8", "int8 64": "in int8, batch 64",
         "train 1": "training step of 64 windows", "train 2": "the same on two threads"}


def duration(us):
    us = float(us)
    return f"{us / 1000:.2f} ms" if us >= 1000 else f"{us:.0f} us"


PACKAGES = {"pytorch": "torch", "torch.compile": "torch", "onnx": "onnxruntime", "openvino": "openvino"}


def with_version(peer, versions):
    """A peer's name, followed by the version of its package as compare.py found it."""
    known = dict(zip(versions.split()[::2], versions.split()[1::2]))
    return f"{peer} {known[package].split('+')[0]}" if (package := PACKAGES.get(peer.split()[0])) in known else peer


def speed(file="peers.csv"):
    return table(["", "SuperTac", "compared with", "", "times as fast (95 % interval)", "share of FMA peak"],
                 [[TASKS[r["task"]], duration(r["ours_us"]), with_version(r["peer"], r["versions"]), duration(r["peer_us"]),
                   f"{float(r['ratio']):.1f} ({float(r['ratio_low']):.1f} to {float(r['ratio_high']):.1f})",
                   f"{100 * float(r['ours_share']):.0f} %"] for r in rows(file)])


def speed_avx2():
    return speed("peers_avx2.csv")


def speed_avx512():
    return speed("peers_avx512.csv")


def precision():
    lines = []
    found = rows("precision.csv")
    for preset in dict.fromkeys(r["name"].split()[0] for r in found):
        of = {kind: [r for r in found if r["name"].split()[0] == preset and r["precision"] == kind] for kind in ("fp32", "int8")}
        lost = [float(a["contact_ssim"]) - float(b["contact_ssim"]) for a, b in zip(of["fp32"], of["int8"])]
        middle = lambda kind, column, digits: f"{mean([float(r[column]) for r in of[kind]]):.{digits}f}"
        lines.append([preset, *(middle(kind, column, digits) for column, digits in (("contact_ssim", 4), ("contact_psnr_db", 2))
                                for kind in of), f"{max(lost):.4f}", *(middle(kind, "median_us", 0) + " us" for kind in of)])
    return table(["model", "contact SSIM in fp32", "in int8", "PSNR dB in fp32", "in int8", "most that a seed loses",
                  "time of a picture in fp32", "in int8"], lines)


def streaming():
    f = {r["figure"]: float(r["value"]) for r in rows("streaming.csv")}
    return table(["a window every millisecond, us", "median", "99.9 %"],
                 [["processor time", f"{f['cpu_median_us']:.0f}", f"{f['cpu_p99.9_us']:.0f}"],
                  ["time on the wall", f"{f['wall_median_us']:.0f}", f"{f['wall_p99.9_us']:.0f}"]]) + (
        f"\n\nThe process ran for {f['windows'] / 1000:.0f} s, held {f['peak_resident_mb']:.0f} MB, and drew its first picture "
        f"{f['ready_ms']:.0f} ms after its start.")


def growth():
    lines = []
    for axis, column, unit, name in (("timesteps", "value", "sample of the window", "length of the window, 32 to 512"),
                                     ("batch", "value", "window", "batch, 1 to 256"),
                                     ("channels", "mmac", "million multiply-adds", "channels, 8 to 96"),
                                     ("training_windows", "value", "window of the data set", "training, 512 to 4096 windows")):
        chosen = [r for r in rows("linear_cost.csv") if r["axis"] == axis]
        start, slope, r = line_through([float(c[column]) for c in chosen], [float(c["us"]) for c in chosen])
        lines.append([name, f"{start:.0f} us", f"{slope:.3g} us a {unit}", f"{r:.3f}"])
    return table(["what grows", "fixed cost", "cost of one more", "r"], lines)


def pixels():
    lines = []
    for split in ("trial", "pass", "window"):
        by_scale = {}
        for r in rows(f"pixels_{split}.csv"):
            by_scale.setdefault(r["scale"], []).append(r)
        lines.append([f"`{split}`"] + [f"{over_seeds(by_scale[s], 'ssim', 3)}, {mean([float(r['psnr_db']) for r in by_scale[s]]):.1f} dB"
                                       for s in ("2", "4", "8")])
    return table(["split", "8x8", "16x16", "32x32"], lines)


VIEWS = {"frame": "last 4x4 frame, levelled", "history32": "last 32 frames, no network", "latents": "latents",
         "super_resolved": "super-resolved 16x16", "truth": "the plate itself"}


def textures():
    found = {(r["view"], r["part"]): r for r in rows("classification.csv") if r["split"] == "trial"}
    lines = []
    for view, name in VIEWS.items():
        cells = (found[view, part] for part in ("inside", "contact", "all"))
        lines.append([name] + [f"{100 * float(c['accuracy']):.1f} ({100 * float(c['passes_ci95_low']):.0f} to "
                               f"{100 * float(c['passes_ci95_high']):.0f})" for c in cells])
    return table(["what the classifier sees", "inside", "contact", "all"], lines)


def felt():
    found = rows("felt.csv")
    return table(["mm since the first contact"] + [r["felt_mm"] for r in found],
                 [["contact SSIM"] + [r["contact_ssim"] for r in found], ["PSNR dB"] + [r["contact_psnr_db"] for r in found]])


def simulator():
    return table(["simulated passes to train on", "seeds", "contact SSIM", "contact PSNR dB", "position error mm", "against the whole"],
                 [[r["simulator"].replace("_", " "), r["seeds"], plus_minus(r["contact_ssim"], r["contact_ssim_ci95"], 3),
                   plus_minus(r["contact_psnr_db"], r["contact_psnr_db_ci95"], 1), f"{float(r['position_error_mm']):.2f}",
                   f"{float(r['ssim_gain']):+.3f}"] for r in rows("simulator_ablation.csv")])


def terms():
    found = rows("simulator_terms.csv")
    names = list(dict.fromkeys(r["simulator"] for r in found))
    of = lambda name: [r for r in found if r["simulator"] == name]
    whole = mean([float(r["contact_ssim"]) for r in of("whole")])
    return table(["simulated passes to train on", "contact SSIM by seed", "PSNR dB", "mean against the whole"],
                 [[name, ", ".join(f"{float(r['contact_ssim']):.3f}" for r in of(name)),
                   ", ".join(f"{float(r['contact_psnr_db']):.1f}" for r in of(name)),
                   f"{mean([float(r['contact_ssim']) for r in of(name)]) - whole:+.3f}"] for name in names])


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


def rig():
    pulls, kills = rows("rig/unplug.csv"), rows("rig/kill.csv")
    soak = {r["quantity"]: float(r["measured"]) for r in rows("rig/soak.csv")}
    ends, calls = rows("rig/ends.csv"), rows("rig/io.csv")

    def latest(port, when):
        return max(float(r["noticed_ms"]) for r in pulls if (r["port"], r["when"]) == (port, when))

    lost = sorted(float(r["lost_s"]) for r in kills)
    lines = [
        ["`rig/unplug.csv`", f"{len(pulls)} cables pulled; the latest was noticed after {latest('board', 'idle'):.1f} ms (board idle), "
         f"{latest('printer', 'idle'):.1f} ms (printer idle), {latest('board', 'collection'):.1f} and "
         f"{latest('printer', 'collection'):.1f} ms (in a collection)"],
        ["`rig/kill.csv`", f"{len(kills)} kills of a running collection lost {lost[len(lost) // 2]:.2f} s (median) and at most {lost[-1]:.3f} s; "
         f"{sum(bool(r['broken']) for r in kills)} broke a promise"],
        ["`rig/ends.csv`", f"{len(ends)} ends by signal or full disk; {sum(bool(r['broken']) for r in ends)} left the finger down, "
         "a wrong exit code or more than one line"],
        ["`rig/io.csv`", f"{len(calls)} collections with one failing call or short writes; {sum(bool(r['broken']) for r in calls)} ended "
         "otherwise than promised"],
        ["`rig/soak.csv`", f"{soak['seconds']:.0f} s of a board with seeded faults: {soak['frames lost']:.0f} frames lost, "
         f"{soak['losses counted']:.0f} counted; {soak['latency median ms']:.2f} ms from frame to picture, {soak['latency p99 ms']:.2f} ms at "
         f"the 99th percentile; {soak['memory kB'] / 1000:.1f} MB, drift {soak['memory drift kB']:.0f} kB"],
    ]
    return table(["file", "result"], lines)


def promises():
    return table(["promise", "how it is tested", "figure"], [[r["promise"], r["tests"], r["figure"]] for r in rows("promises.csv")])


def hostile():
    counted = ["slow mutants", "crashes", "hangs", "above 1 GB", "raw exceptions", "control codes", "shells", "files overwritten", "half folders"]
    lines = []
    for campaign in dict.fromkeys(r["campaign"] for r in rows("hostile.csv")):
        found = {r["what"]: r["count"] for r in rows("hostile.csv") if r["campaign"] == campaign}
        tried = next(what for what in ("command lines", "mutants", "signals") if what in found)
        lines.append([campaign, f"{int(found[tried]):,}"] +
                     [found[c] for c in counted])
    return table(["what was tried", "how many"] + counted, lines)


def page():
    runs, hour = rows("page_load.csv"), rows("page_hour.csv")
    of = lambda load, column: [float(r[column]) for r in runs if r["load"] == load]
    p99 = {(r["pair"], r["load"]): float(r["p99_ms"]) for r in runs}
    ratios = sorted(p99[pair, "with"] / p99[pair, "without"] for pair, load in p99 if load == "with")
    middle = (ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2]) / 2
    lines = [["`page_load.csv`", f"{len(ratios)} pairs: 99th percentile from frame to picture with the load {middle:.2f} times that without "
              f"(median; {ratios[0]:.2f} to {ratios[-1]:.2f}), while the host gave {mean(of('with', 'stolen_percent')):.0f} % of the time to "
              f"others with and {mean(of('without', 'stolen_percent')):.0f} % without; frames lost in the port "
              f"{sum(of('with', 'lost')):.0f} of {sum(of('with', 'frames')):.0f} with, "
              f"{sum(of('without', 'lost')):.0f} of {sum(of('without', 'frames')):.0f} without; "
              f"{mean(of('with', 'events_a_page_a_second')):.1f} pictures a second for each page that reads"]]
    span = lambda column: f"{min(float(r[column]) for r in hour):.0f} to {max(float(r[column]) for r in hour):.0f}"
    lines.append(["`page_hour.csv`", f"{float(hour[-1]['seconds']):.0f} s: heap of the page {span('page_heap_kb')} kB, {span('bytes_a_second')} bytes a "
                  f"second; the program's memory grew by {float(hour[-1]['program_resident_kb']) - float(hour[0]['program_resident_kb']):.0f} kB"])
    return table(["file", "result"], lines)


def mutation():
    lines = []
    for folder, group in itertools.groupby(rows("audit/mutation.csv"), lambda r: r["file"].split("/")[0]):
        mutants = list(group)
        lives = [f"`{r['file']}:{r['line']}`: {r['why it lives']}" for r in mutants if r["verdict"] == "survived"]
        lines.append([folder, str(len(mutants)), str(len(mutants) - len(lives)), "; ".join(lives) or "none"])
    return table(["folder", "mutants", "noticed", "not noticed, and why"], lines)


def never_felt():
    return table(["tried", "random plates", "options", "left out", "contact SSIM", "contact PSNR dB", "ghosts on flat", "verdict"],
                 [[r["recipe"], r["random_plates"], f"`{r['options']}`", r["left_out"], r["contact_ssim"],
                   r["contact_psnr_db"], f"{100 * float(r['flat_ghost_rate']):.1f} %", r["verdict"]]
                  for r in rows("never_felt.csv")])


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


def whole_passes():
    lines = []
    for (network, windows_of), group in itertools.groupby(rows("whole_passes.csv"), lambda r: (r["network"], r["windows_of"])):
        chosen = list(group)
        middle = lambda column: mean([float(r[column]) for r in chosen])
        percent = lambda column: f"{100 * middle(column):.1f} %"
        lines.append([network, windows_of, ", ".join(r["seed"] for r in chosen), over_seeds(chosen, "contact_ssim", 3),
                      over_seeds(chosen, "contact_psnr_db", 1), f"{middle('position_error_mm'):.2f}", percent("miss_rate"),
                      percent("flat_ghost_rate"), percent("coverage"), f"{middle('sure_ssim'):.3f}", f"{middle('auroc'):.2f}",
                      f"{middle('spread_near') / middle('spread_far'):.2f}"])
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


def tried():
    lines = []
    for key, group in itertools.groupby(rows("generalisation.csv"), lambda r: (r["idea"], r["options"], r["verdict"], r["commit"])):
        chosen = list(group)
        lines.append([key[0], f"`{key[1]}`", ", ".join(r["seed"] for r in chosen), over_seeds(chosen, "contact_ssim", 3),
                      over_seeds(chosen, "contact_psnr_db", 1), over_seeds(chosen, "position_error_mm", 2), key[2], key[3]])
    return table(["idea", "options, or the constant that was changed", "seeds", "contact SSIM", "PSNR dB", "position mm", "verdict",
                  "commit"], lines)


SECTIONS = {PAGE: [sources, accuracy, phase, history, parts, felt, imported, baselines, speed, speed_avx512, speed_avx2, precision, streaming, growth, pixels, textures, simulator, stability, optimizers,
                   rig, page, hostile, promises, mutation, whole_passes, silent_signals, corruptions, unknown_plates, demo, tried, left_out, never_felt, simulated_only, finger_fit, terms],
            README: [accuracy, speed]}


# Lines of the page's tables that the README leaves out.
NOT_IN_README = re.compile(r"^\| (nearest|(inference|in int8)[^|]*\| [^|]* \| (pytorch eager|onnx runtime|onnx runtime int8|openvino int8) [\d.]+ |[^|]*batch 8 |[^|]*\| [^|]* \| torch\.compile ).*\n", re.MULTILINE)


def rewritten(path):
    text = path.read_text()
    for section in SECTIONS[path]:
        name, body = section.__name__, section()
        if path == README:
            body = NOT_IN_README.sub("", body)
        new = f"<!-- {name} -->\n{body}\n<!-- /{name} -->"
        text, count = re.subn(f"<!-- {name} -->.*<!-- /{name} -->", lambda _: new, text, flags=re.DOTALL)
        if count != 1:
            sys.exit(f"results.py: {path.relative_to(ROOT)} has no lines <!-- {name} --> and <!-- /{name} -->")
    return text


def unnamed():
    """Files of results that sources.csv does not name, and the other way round."""
    named = {name.strip(" `") for r in rows("sources.csv") for name in r["file"].split(",")}
    present = {str(path.relative_to(RESULTS)) for path in RESULTS.rglob("*") if path.is_file()} - {"README.md", "sources.csv"}
    return ([f"bench/results/{name} has no line in sources.csv: say command, commit, split, seeds and date" for name in sorted(present - named)] +
            [f"sources.csv names {name}, which is not in bench/results" for name in sorted(named - present)])


def main():
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    complaints = unnamed()
    for path in SECTIONS:
        text = rewritten(path)
        if text != path.read_text():
            if sys.argv[1:]:
                complaints.append(f"{path.relative_to(ROOT)} is older than the CSV files: run bench/results.py")
            else:
                path.write_text(text)
    for complaint in complaints:
        print(f"results.py: {complaint}", file=sys.stderr)
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
