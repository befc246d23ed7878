"""What is seen of an unseen trial, what each part buys, and the simulator against reality."""
import itertools

from .figures import mean, over_seeds, plus_minus, rows, table

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


def felt():
    found = rows("felt.csv")
    return table(["mm since the first contact"] + [r["felt_mm"] for r in found],
                 [["contact SSIM"] + [r["contact_ssim"] for r in found], ["PSNR dB"] + [r["contact_psnr_db"] for r in found]])


def imported():
    found = rows("import.csv")
    moved = sorted(abs(float(r["aligned_by_mm"])) for r in found if r["aligned_by_mm"])
    return table(["imported", ""], [
        ["passes, and those that fit their plate", f"{len(found)}, {sum(r['reliable'] == 'yes' for r in found)}"],
        ["mean residual of a contact", f"{mean([float(r['residual_mm']) for r in found]):.2f} mm"],
        ["passes aligned with others of their plate", f"{len(moved)}, by {moved[len(moved) // 2]:.2f} mm (median), at most {moved[-1]:.2f} mm"],
        ["passes with a further loss found by alignment", f"{sum(bool(r['further_loss_s']) for r in found)}"]])


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
    whole = lambda network: [r for r in rows("whole_passes.csv") if (r["network"], r["windows_of"]) == (network, "trial 2")]
    muon = [r for r in rows("optimizers.csv") if (r["training"], r["windows_of"], r["optimizer"]) == ("preset paper", "trial 2", "muon")]

    def with_ghosts(chosen):
        return (f"{over_seeds(chosen, 'contact_ssim', 3)}, {over_seeds(chosen, 'contact_psnr_db', 1)} dB, ghosts "
                f"{100 * mean([float(r['flat_ghost_rate']) for r in chosen]):.1f} %")

    lines += [
        ["V of VAE; whole passes, Muon", with_ghosts(muon), with_ghosts(whole("preset paper (muon; plain autoencoder)")), "",
         "`optimizers.csv`, `whole_passes.csv`, five seeds"],
        ["SSIM term, lambda .1 against 0; `tiny`, whole passes", with_ghosts(whole("preset tiny")),
         with_ghosts(whole("preset tiny; lambda 0")), "", "`whole_passes.csv`, five seeds"],
    ]
    for line in lines:
        if not line[3]:
            line[3] = f"{float(line[1].split()[0]) - float(line[2].split()[0]):+.3f}"
    return table(["part", "with", "without", "what it buys", "from"], lines)


def history():
    return table(["what was added", "commit", "contact SSIM", "contact PSNR dB"],
                 [[r["step"], r["commit"], plus_minus(r["contact_ssim"], r["contact_ssim_ci95"], 3),
                   plus_minus(r["contact_psnr_db"], r["contact_psnr_db_ci95"], 1)] for r in rows("history.csv")])


def baselines():
    return table(["method", "contact SSIM", "contact PSNR dB", "all SSIM", "all PSNR dB", "time of a picture", "seeds"],
                 [[r["method"], plus_minus(r["contact_ssim"], r["contact_ssim_ci95"], 3),
                   plus_minus(r["contact_psnr_db"], r["contact_psnr_db_ci95"], 1), f"{float(r['all_ssim']):.3f}",
                   f"{float(r['all_psnr_db']):.1f}", f"{float(r['median_us']):.1f} us", r["seeds"]] for r in rows("baselines.csv")])


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


def tried():
    lines = []
    for key, group in itertools.groupby(rows("generalisation.csv"), lambda r: (r["idea"], r["options"], r["verdict"], r["commit"])):
        chosen = list(group)
        lines.append([key[0], f"`{key[1]}`", ", ".join(r["seed"] for r in chosen), over_seeds(chosen, "contact_ssim", 3),
                      over_seeds(chosen, "contact_psnr_db", 1), over_seeds(chosen, "position_error_mm", 2), key[2], key[3]])
    return table(["idea", "options, or the constant that was changed", "seeds", "contact SSIM", "PSNR dB", "position mm", "verdict",
                  "commit"], lines)


TABLES = [accuracy, phase, felt, imported, parts, history, baselines, pixels, textures, simulator, terms, tried]
