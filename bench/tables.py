"""The tables of README.md and bench/results, each made from CSV files by the function of its name."""
import csv
import functools
import math
import pathlib
import random
import statistics

RESULTS = pathlib.Path(__file__).resolve().parent / "results"
T_975 = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}  # Student's t


def rows(name):
    """Lines of a CSV; `command` and `commit` are filled from the line above."""
    with open(RESULTS / name, newline="") as file:
        found = list(csv.DictReader(file))
    source = {}
    for number, row in enumerate(found, 2):  # a stray comma would move all columns behind it
        if None in row or None in row.values():
            raise SystemExit(f"{name}: line {number} has not as many values as the head; quote commas within a value")
        source |= {key: row[key] for key in ("command", "commit") if row.get(key)}
        row.update(source)
    return found


def chosen(found, **wanted):
    return [r for r in found if all(r[key] == value for key, value in wanted.items())]


def table(head, lines):
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *lines])


def mean(found, column):
    return statistics.fmean(float(r[column]) for r in found if r[column])


def percent(found, column, digits=1):
    return f"{100 * mean(found, column):.{digits}f} %"


def spans(found, column, digits):
    """The mean and, of few lines, the least and the largest."""
    values = [float(r[column]) for r in found]
    return f"{statistics.fmean(values):.{digits}f} ({min(values):.{digits}f} to {max(values):.{digits}f})"


def plus_minus(value, half, digits):
    return f"{float(value):.{digits}f}" + (f" ± {float(half):.{digits}f}" if float(half or 0) > 0 else "")


def over_seeds(found, column, digits=3):
    """Mean and 95 % interval; the values themselves where they are fewer than three."""
    values = [float(r[column]) for r in found if r[column]]
    if len(values) < 3:
        return ", ".join(f"{v:.{digits}f}" for v in values)
    half = T_975.get(len(values) - 1, 1.96) * statistics.stdev(values) / math.sqrt(len(values))
    return plus_minus(statistics.fmean(values), half, digits)


@functools.cache
def draws(passes, seeds, count=2000):
    """Seeds and passes of the hierarchical bootstrap: as many of each as there are, with replacement, passes within their
    plates (data/scores/statistics.h); `passes`: (plate, pass)."""
    chance, plates = random.Random(0), {}
    for one in passes:
        plates.setdefault(one[0], []).append(one)
    return [(chance.choices(seeds, k=len(seeds)), [p for of in plates.values() for p in chance.choices(of, k=len(of))])
            for _ in range(count)]


def over_passes(found, column, digits=3):
    """Mean over windows, and its 95 % interval over seeds and passes."""
    windows = {(r["seed"], (r["plate"], r["pass"])): float(r["windows"]) for r in found}
    sums = {(r["seed"], (r["plate"], r["pass"])): float(r[column]) * float(r["windows"]) for r in found}
    seeds, passes = (tuple(dict.fromkeys(key[i] for key in sums)) for i in (0, 1))
    means = []
    for drawn, of in draws(passes, seeds):
        keys = [(s, p) for s in drawn for p in of]
        means.append(sum(map(sums.get, keys)) / sum(map(windows.get, keys)))
    means.sort()
    low, high = means[len(means) // 40], means[-1 - len(means) // 40]
    return f"{sum(sums.values()) / sum(windows.values()):.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


# How good is the picture? ---------------------------------------------------------------------------------------------

def apart(network="paper"):
    return chosen(rows("accuracy/passes.csv"), network=network)


LATE = "paper, 0.6 s later"


def told_apart(found):
    """The share of windows (%) whose pass is of the plate that its map's elements name, by kind and pitch."""
    name = lambda r: f"{round(36 / float(r['pitch_mm']))}_{r['kind'].title()}" if r["pitch_mm"] else ""
    return 100 * weighted([r | {"right": name(r) == r["plate"]} for r in found], "right")


def weighted(found, column, by="windows"):
    return sum(float(r[column]) * float(r[by]) for r in found) / sum(float(r[by]) for r in found)


def beside_the_paper():
    short = chosen(rows("paper/figure7.csv"), split="window")
    named = lambda split, part: 100 * float(chosen(rows("paper/figure11.csv"), split=split, view="super_resolved",
                                                   part=part)[0]["accuracy"])
    return table(["figure", "paper", "ours, split `window`", "ours, unseen trial"], [
        ["SSIM", "0.81", over_seeds(short, "ssim"),
         f"{over_passes(apart(), 'ssim')}; 0.6 s later {over_passes(apart(LATE), 'ssim')}, map {over_passes(apart(LATE), 'map_ssim')}"],
        ["PSNR", "27.3 dB", over_seeds(short, "psnr_db", 1) + " dB", over_passes(apart(), "psnr_db", 1) + " dB"],
        ["position error", "0.65 mm", f"{mean(short, 'position_mm'):.2f} mm",
         f"{weighted(chosen(rows('accuracy/surfaces.csv'), network='paper'), 'position_error_mm'):.2f} mm"],
        ["textures told apart", "93.1 %", *(f"{named(split, 'contact'):.1f} % ({named(split, 'inside'):.1f} % inside)" + by_map
                                            for split, by_map in (("window", ""), ("trial", f", by the map {told_apart(apart(LATE)):.1f} %")))]])


def reached():
    four, baselines = apart("all but this one, averaged"), rows("accuracy/baselines.csv")
    names = {"mean_image": "mean image", "ridge": "ridge regression"}
    parts = {"picture": "", "map of the pass": "map_"}
    lines = [[f"`{name}`, {part}", over_passes(apart(network), prefix + "ssim"), over_passes(apart(network), prefix + "psnr_db", 1)]
             for name, network in (("paper", "paper"), ("paper --delay 0.6", LATE)) for part, prefix in parts.items()]
    lines.append(["four of `paper` averaged, picture", over_passes(four, "ssim"), over_passes(four, "psnr_db", 1)])
    return table(["drawn by", "contact SSIM", "PSNR dB"],
                 lines + [[names.get(r["method"], r["method"]), f"{float(r['ssim']):.3f}", f"{float(r['psnr_db']):.1f}"] for r in baselines])


def aligned():
    found, lines = rows("accuracy/whole_passes.csv"), []
    for network in ("paper", "tiny"):
        of = [chosen(found, network=network, registered=how) for how in ("aligned", "independent")]
        lines.append([f"`{network}`", *(f"{over_seeds(one, 'contact_ssim')}, {over_seeds(one, 'contact_psnr_db', 1)} dB" for one in of),
                      percent(of[0], "flat_ghost_rate"), percent(of[0], "miss_rate")])
    return table(["network", "all passes aligned together", "those of the test registered alone", "ghost rate", "miss rate"], lines)


def maps():
    columns = {"ssim": "picture", "map_ssim": "map of the pass", "plate_map_ssim": "map of all passes",
               "kind_map_ssim": "of the pass, any kind", "kind_plate_map_ssim": "of all, any kind"}
    lines = []
    for network, name in (("paper", "`paper`"), (LATE, "`--delay 0.6`")):
        found, surfaces = apart(network), chosen(rows("accuracy/surfaces.csv"), network=network)
        for plate in [*dict.fromkeys(r["plate"] for r in found), "all"]:
            of, its = ([r for r in some if plate in ("all", r["plate"])] for some in (found, surfaces))
            first = [f"{weighted(its, c, 'first_15_mm_windows'):.3f}" for c in ("first_15_mm_ssim", "map_first_15_mm_ssim")]
            lines.append([name, plate, *(over_passes(of, c) for c in columns), *first])
    return table(["network", "plate", *columns.values(), "first 15 mm: picture", "map"], lines)


def later():
    found, lines = rows("accuracy/later.csv"), []
    for way in dict.fromkeys(r["way"] for r in found):
        of = chosen(found, way=way)
        lines.append([way, *(", ".join(r[c] for r in of if r[c]) for c in ("picture_ssim", "map_ssim"))])
    return table(["drawn by `paper`", "picture", "map of the pass"], lines)


def shown_elements():
    found, lines = rows("accuracy/elements.csv"), []
    names = {"paper": "all four plates", "paper, 0.6 s later": "all four, `--delay 0.6`", "without the plate": "three others",
             "random plates beside": "and random ones", "random plates beside, 0.6 s later": "and random ones, `--delay 0.6`"}
    for network, trial in [("paper", "2"), ("paper, 0.6 s later", "2"), *((n, t) for t in "12" for n in list(names)[2:])]:
        for plate in [*dict.fromkeys(r["plate"] for r in found), "all"]:
            of = [r for r in chosen(found, network=network, trial=trial, map_of="plate") if plate in ("all", r["plate"])]
            if network in ("paper", "without the plate", "random plates beside") and plate != "all":
                continue
            total = {key: sum(int(r[key]) for r in of) for key in ("existing", "found", "false")}
            lines.append([plate, names[network], trial, f"{total['found']} of {total['existing']}", str(total["false"]),
                          *(f"{mean(of, c):.2f}" if any(r[c] for r in of) else "" for c in ("median_mm", "pitch_error_mm")),
                          *(f"{mean(of, c):.3f}" for c in ("ssim", "stated_ssim"))])
    return table(["plate", "networks of", "trial", "found", "false", "off by mm", "pitch off by mm", "SSIM", "SSIM, kind stated"], lines)


def first_contact():
    found = rows("accuracy/first_contact.csv")
    return table(["mm since the first contact"] + [r["felt_mm"] for r in found],
                 [["contact SSIM"] + [f"{float(r['contact_ssim']):.2f}" for r in found],
                  ["PSNR dB"] + [r["contact_psnr_db"] for r in found]])


def demo():
    names = {"trial 2 of its six plates": "trial 2 of its six plates", "eight plates never felt": "eight unseen plates",
             "trial 2 of a plain plate": "trial 2 of a plain plate"}
    return table(["windows of", "contact SSIM", "PSNR dB", "position error mm", "ghost rate", "SSIM of ridge regression"],
                 [[names[r["windows of"]], r["contact_ssim"], r["contact_psnr_db"], r["position_mm"],
                   f"{100 * float(r['flat_ghost_rate']):.1f} %", ridge["contact_ssim"]]
                  for r, ridge in zip(chosen(rows("accuracy/demo.csv"), method="network"),
                                      chosen(rows("accuracy/demo.csv"), method="ridge"))])


# On plates it has not seen --------------------------------------------------------------------------------------------

def left_out():
    found = rows("unseen_plates/left_out.csv")
    four = ("3_Bumps", "6_Bumps", "4_Ridges", "6_Ridges")
    plates = {plate: chosen(found, left_out=plate) for plate in (*four, "4_Blob", "6_Blob", "4_Waves", "6_Waves")}

    def line(name, of):
        optional = lambda column: over_seeds(of, column) if any(r[column] for r in of) else ""
        return [name, over_seeds(of, "contact_ssim"), over_seeds(of, "contact_psnr_db", 1), percent(of, "flat_ghost_rate"),
                percent(of, "miss_rate"), percent(of, "coverage"), optional("independent_ssim"),
                optional("without_random_plates_ssim")]

    def by_seed():
        for seed in sorted({r["seed"] for r in plates["3_Bumps"]}):
            of = [chosen(plates[plate], seed=seed)[0] for plate in four]
            yield {column: str(mean(of, column)) for column in of[0] if column not in ("left_out", "seed", "command", "commit")}

    return table(["plate left out", "contact SSIM", "PSNR dB", "ghost rate", "miss rate", "intervals hold", "SSIM on trial 2",
                  "without random plates"],
                 [line(plate, of) for plate, of in plates.items()] + [line("mean of the first four", list(by_seed()))])


# Other sensors --------------------------------------------------------------------------------------------------------

def other_sensors():
    found = rows("sensors.csv")

    def line(name, method):
        of = chosen(found, set=name, method=method)
        optional = lambda text, column: text(of, column) if of[0][column] else ""
        figures = lambda digits: lambda of, column: f"{mean(of, column):.{digits}f}"
        contact = figures(3)(of, "contact_ssim")
        return [name, method, spans(of, "ssim", 3), figures(1)(of, "psnr_db"), contact if contact != figures(3)(of, "ssim") else "",
                optional(figures(3), "peak_ssim"), optional(figures(1), "peak_psnr_db"), optional(percent, "coverage")]

    sets, methods = (dict.fromkeys(r[column] for r in found) for column in ("set", "method"))
    return table(["set", "method", "SSIM", "PSNR dB", "contact SSIM", "peak SSIM", "peak PSNR dB", "intervals hold"],
                 [line(name, method) for name in sets for method in methods if chosen(found, set=name, method=method)])


def few_shot():
    found, full = rows("few_shot.csv"), rows("sensors.csv")

    def line(name):
        cells = [chosen(found, set=name, groups=groups, method=method) for groups, method in
                 (("0", "bicubic"), ("0", "back-projection"), *((groups, "network") for groups in ("0", "1", "3", "10")))]
        cells.append(chosen(full, set=name, seed="0", method="one frame"))
        return [name] + [f"{mean(of, 'ssim'):.3f}" if of else "" for of in cells]

    return table(["set", "bicubic", "back-projection", "no truth", "1 group", "3", "10", "all"],
                 [line(name) for name in dict.fromkeys(r["set"] for r in found)])


# When the sensor misbehaves -------------------------------------------------------------------------------------------

def corruptions():
    found, lines = rows("sensor_faults/corruptions.csv"), []
    for name in dict.fromkeys(r["corruption"] for r in found if r["corruption"] != "none"):
        of = lambda model, severity, name=name: chosen(found, model=model, corruption=name, severity=severity)
        lines.append([name] + [f"{mean(of('paper', s), 'ssim'):.3f}" for s in "135"] +
                     [f"{mean(of(model, '3'), 'ssim'):.3f}" for model in ("tiny", "four of paper")] +
                     [percent(of("paper", "3"), "coverage", 0), f"{mean(of('paper', '3'), 'alarm_auroc'):.2f}",
                      percent(of("paper", "3"), "alarms", 0)])
    return table(["corruption", "`paper`, severity 1", "3", "5", "`tiny`, 3", "four of `paper`, 3", "intervals hold, 3",
                  "AUROC of the alarm, 3", "alarms, 3"], lines)


def silence():
    found = rows("sensor_faults/silent_signals.csv")
    signals = [("constant", "0"), ("noisy", "0.01"), ("noisy", "0.04"), ("drifting", "0.02"), ("drifting", "0.1")]
    lines = []
    for network, shown in (("paper", "no"), ("paper", "yes"), ("tiny", "no"), ("tiny", "yes"), ("demo", "yes")):
        of = lambda kind, strength: chosen(found, network=network, silent_passes=shown, signals=kind, strength=strength)
        lines.append([f"`{network}`", shown] + [percent(of(*signal), "ghost_rate") for signal in signals])
    return table(["network", "silent passes in training"] + [kind if s == "0" else f"{kind}, {s}" for kind, s in signals], lines)


# How fast -------------------------------------------------------------------------------------------------------------

TASKS = {"infer": "batch {}", "train": "training step, {} threads"}
PACKAGES = {"pytorch": "torch", "torch.compile": "torch", "onnx": "onnxruntime", "openvino": "openvino", "mnn": "mnn",
            "litert": "ai_edge_litert", "executorch": "executorch", "ncnn": "ncnn"}


def duration(us):
    return f"{float(us) / 1000:.2f} ms" if float(us) >= 1000 else f"{float(us):.0f} us"


def task(r):
    kind, number = r["task"].split()
    return TASKS[kind].format(number).replace("1 threads", "1 thread")


def ratio(r):
    return f"{float(r['ratio']):.1f} ({float(r['ratio_low']):.1f} to {float(r['ratio_high']):.1f})"


def with_version(r):
    known = dict(zip(r["versions"].split()[::2], r["versions"].split()[1::2]))
    package = PACKAGES.get(r["peer"].split()[0])
    return f"{r['peer']} {known[package].split('+')[0]}" if package in known else r["peer"]


def fastest():
    """For README: the engine that comes closest, of two tasks."""
    lines = []
    for name, wanted in (("one picture", "infer 1"), ("training step of 64 windows", "train 1")):
        r = min(chosen(rows("speed/peers_avx512.csv"), task=wanted), key=lambda r: float(r["ratio"]))
        lines.append([name, duration(r["ours_us"]), f"{duration(r['peer_us'])} ({with_version(r)})", ratio(r)])
    return table(["task", "SuperTac", "fastest other engine", "times as fast (95 % interval)"], lines)


def speed():
    machines = [rows(f"speed/{name}.csv") for name in ("peers", "peers_avx512", "peers_avx2")]
    lines = []
    for kind, peer in sorted({(r["task"], r["peer"]) for found in machines for r in found}, key=in_order):
        of = [chosen(found, task=kind, peer=peer) for found in machines]
        lines.append([task({"task": kind}), with_version(next(r[0] for r in of if r))] +
                     [duration(r[0]["ours_us"]) if r else "" for r in of[:2]] + [ratio(r[0]) if r else "" for r in of])
    return table(["task", "compared with", "ours, AMX", "AVX-512", "times as fast, AMX", "AVX-512", "AVX2"], lines)


def in_order(pair):
    (kind, number), peer = pair[0].split(), pair[1]
    return kind == "train", int(number), kind, list(PACKAGES).index(peer.split()[0]) if peer.split()[0] in PACKAGES else 0, peer


def tail():
    loads = {"idle": "nothing else runs", "compiler": "beside a compiler"}
    return table(["beside it", "", "median", "99 %", "99.9 %", "slowest", "above 1 ms"],
                 [[loads[r["load"]], r["engine"], duration(r["p50_us"]), duration(r["p99_us"]), duration(r["p99.9_us"]),
                   duration(r["worst_us"]), r["above_1_ms"]] for r in rows("speed/tail.csv")])


def cold_start():
    return table(["preset", "", "median ms", "slowest ms", "memory MB"],
                 [[f"`{r['model']}`", r["engine"], f"{float(r['median_ms']):.1f}", f"{float(r['worst_ms']):.1f}", r["memory_mb"]]
                  for r in rows("speed/cold_start.csv")])


def threads():
    """Times one thread, and what the machine gives to trainings that share nothing."""
    found = rows("speed/threads.csv")
    of = lambda r, name: f"{float(r[name]):.1f} ({float(r[name + '_low']):.1f} to {float(r[name + '_high']):.1f})"
    return table(["batch", "threads", "a step", "times one thread", "as many trainings apart"],
                 [[r["batch"], r["threads"], f"{float(r['step_ms']):.1f} ms", of(r, "together"), f"{float(r['apart']):.1f}"]
                  for r in found if r["threads"] != "1"])


def fast_parts():
    """How much longer a task takes without a part."""
    found, columns = rows("speed/fast_parts.csv"), ("paper training step", "tiny training step", "paper one picture",
                                                    "tiny one picture", "paper 64 pictures")
    lines = []
    for part in dict.fromkeys(r["part"] for r in found):
        times = {f"{r['network']} {r['task']}": f"{100 * float(r['without']) - 100:+.0f} %" for r in chosen(found, part=part)}
        lines.append([part, chosen(found, part=part)[0]["lines"]] + [times.get(column, "") for column in columns])
    return table(["without", "lines", *columns], lines)


def whole_job():
    found, lines = rows("speed/whole_job.csv"), []
    for job in dict.fromkeys(r["job"] for r in found):
        of = chosen(found, job=job)
        whole = sum(float(r["seconds"]) for r in of)
        lines += [[job if r is of[0] else "", r["phase"], f"{float(r['seconds']):.1f} s", f"{100 * float(r['seconds']) / whole:.0f} %"]
                  for r in of]
    return table(["job", "", "seconds", "share"], lines)


def precision():
    found, lines = rows("speed/precision.csv"), []
    for network in ("tiny", "paper", "four of paper"):
        fp32, int8 = ([r for r in found if r["name"].rsplit(" ", 1)[0] == network and r["precision"] == p] for p in ("fp32", "int8"))
        lost = max(float(a["contact_ssim"]) - float(b["contact_ssim"]) for a, b in zip(fp32, int8))
        lines.append([network, f"{mean(fp32, 'contact_ssim'):.4f}", f"{mean(int8, 'contact_ssim'):.4f}", f"{lost:.4f}"])
    return table(["network", "contact SSIM in fp32", "in int8", "most that a seed loses"], lines)


# How reliable ---------------------------------------------------------------------------------------------------------

def studies():
    kill, unplug, io, ends = (rows(f"rig/{name}.csv") for name in ("kill", "unplug", "io", "ends"))
    broken = lambda found: sum(r["broken"] not in ("", "0") for r in found)
    soak = {r["quantity"]: r["measured"] for r in rows("rig/soak.csv")}
    mutants, ranks = rows("reliability/mutation.csv"), rows("reliability/rank_faults.csv")
    attacks = rows("reliability/hostile.csv")
    kinds = ("command lines", "mutants", "signals", "lying files", "collections")
    signals = rows("rig/signals.csv")
    heard = [r for r in signals if r["ended_before"] == "0"]
    lies = {r["what"]: r["count"] for r in attacks if r["campaign"] == "lying devices"}
    harm = ("crashes", "hangs", "above 1 GB", "raw exceptions", "control codes", "shells", "files overwritten", "half folders")
    findings = sum(int(r["count"]) for r in attacks if r["what"] in harm)
    lines = [[f"`rig/{name}.csv`", what, f"{len(found)} runs", f"{broken(found)} ended otherwise than promised"]
             for name, what, found in (("kill", "a collecting program is killed", kill), ("ends", "signals and full disks", ends),
                                       ("io", "one system call fails or writes less", io), ("unplug", "a cable is pulled", unplug))]
    for r in rows("rig/faults.csv"):
        lines.append(["`rig/faults.csv`", r["kind"], f"{r['runs']} runs",
                      f"{r['complete']} complete, {r['typed_errors']} typed errors, {r['broken_promises']} broken promises"])
    pairs, hour = rows("rig/page_load.csv"), rows("rig/page_hour.csv")
    p99 = [{key: float(r["p99_ms"]) for r in pairs if r["pair"] == pair for key in [r["load"]]} for pair in {r["pair"] for r in pairs}]
    lines += [
        ["`rig/soak.csv`", "a faulty board is streamed", f"{float(soak['seconds']):.0f} s",
         "every lost frame counted; 0.86 ms from frame to picture at the 99th percentile"],
        ["`rig/page_load.csv`", "the live page under load", f"{len(p99)} pairs",
         f"99th percentile {statistics.median(p['with'] / p['without'] for p in p99):.2f} times that without"],
        ["`rig/page_hour.csv`", "the live page, an hour", f"{float(hour[-1]['seconds']):.0f} s",
         f"the program's memory grew by {float(hour[-1]['program_resident_kb']) - float(hour[0]['program_resident_kb']):.0f} kB"],
        ["`rig/signals.csv`", f"a signal in {len({r['phase'] for r in signals})} phases of what touches a port", f"{len(heard)} runs",
         f"{broken(heard)} ended otherwise than promised; {max(float(r['seconds']) for r in heard):.2f} s at most"],
        *([f"`reliability/sensors.csv`", f"{r['array']} taxels at {int(r['rate_hz']):,} Hz over {r['port']}",
           f"{float(r['seconds']):.0f} s", f"{int(r['sent']) - int(r['shown']):,} of {int(r['sent']):,} frames lost; "
           f"{float(r['p99_ms']):.1f} ms from sending to the raw array, 99th percentile"]
          for r in rows("reliability/sensors.csv")),
        ["`reliability/hostile.csv`", "evil options, mutated and lying files, lying devices, signals",
         f"{sum(int(r['count']) for r in attacks if r['what'] in kinds):,}", f"{findings} crashes, hangs or overwritten files; {lies['broken promises']} of {lies['collections']} lying devices "
         "led to a wrong word"],
        ["`reliability/rank_faults.csv`", "kills, freezes, full disks with several ranks", f"{len(ranks)} runs",
         f"{sum(r['in_time'] == 'True' for r in ranks)} ended in time, with one line"],
        ["`reliability/ledger_tampering.csv`", "a training is falsified", f"{len(rows('reliability/ledger_tampering.csv'))}",
         f"{sum(r['right'] == 'yes' for r in rows('reliability/ledger_tampering.csv'))} found, with step and array"],
        ["`reliability/mutation.csv`", "one place of the source is broken", f"{len(mutants)}",
         f"{sum(r['verdict'] == 'killed' for r in mutants)} noticed by a test"]]
    return table(["file", "what is done", "how often", "result"], lines)


# What each part buys --------------------------------------------------------------------------------------------------

def parts():
    base = {r["method"]: r for r in rows("parts/baselines.csv")}
    step = {" ".join(r["step"].split()[:2]): r for r in rows("parts/history.csv")}
    whole = lambda network: chosen(rows("accuracy/whole_passes.csv"), network=network, registered="aligned")
    lines = []

    def add(part, with_it, without, source):
        both = []
        for of in (with_it, without):
            if isinstance(of, dict):
                both.append((float(of["contact_ssim"]), float(of["contact_psnr_db"]), plus_minus(of["contact_ssim"], of["contact_ssim_ci95"], 3)))
            else:
                both.append((mean(of, "contact_ssim"), mean(of, "contact_psnr_db"), over_seeds(of, "contact_ssim")))
        lines.append([part, both[0][2], both[1][2], f"{both[0][0] - both[1][0]:+.3f}", f"{both[0][1] - both[1][1]:+.1f}", f"`{source}`"])

    add("a window of time instead of one frame", base["paper"], base["one frame, our blocks"], "parts/baselines.csv")
    add("windows three times as long (100 Hz)", step["windows at"], step["first training:"], "parts/history.csv")
    add("SSIM term in the loss (`tiny`)", whole("tiny"), whole("tiny without the SSIM term"), "accuracy/whole_passes.csv")
    add("lost frames without a step found", step["losses that"], step["passes of"], "parts/history.csv")
    add("finger lifted in augmentation", step["the finger"], step["windows normalised"], "parts/history.csv")
    add("clocks restored", step["clocks of"], step["the finger"], "parts/history.csv")
    add("passes of a plate aligned", step["passes of"], step["clocks of"], "parts/history.csv")
    add("four networks averaged (`paper`)", base["best: four of paper averaged"], base["paper"], "parts/baselines.csv")
    add("Muon instead of Adam (`paper`)", whole("paper with Muon"), whole("paper"), "accuracy/whole_passes.csv")
    add("V of the VAE (`paper` with Muon)", whole("paper with Muon"), whole("best"), "accuracy/whole_passes.csv")
    add("silent passes in training (`tiny`)", whole("tiny"), whole("tiny without silent passes"), "accuracy/whole_passes.csv")
    add("transposed instead of sub-pixel convolution", base["paper"], base["paper, sub-pixel"], "parts/baselines.csv")
    add("random plates in training (`tiny`, known plates)", whole("tiny with 1,500 random plates"), whole("tiny"),
        "accuracy/whole_passes.csv")
    return table(["part", "contact SSIM with it", "without it", "SSIM", "PSNR dB", "from"], lines)


def simulator_terms():
    found = rows("parts/simulator_terms.csv")
    whole = mean(chosen(found, simulator="whole"), "contact_ssim")
    lines = []
    for name in dict.fromkeys(r["simulator"] for r in found):
        of = chosen(found, simulator=name)
        change = mean(of, "contact_ssim") - whole
        if name == "whole" or change < -0.03:
            lines.append([name, f"{mean(of, 'contact_ssim'):.3f}", f"{mean(of, 'contact_psnr_db'):.1f}", f"{change:+.3f}", str(len(of))])
    return table(["simulated passes to train on", "contact SSIM", "PSNR dB", "against the whole", "seeds"], lines)


def tried():
    found, lines = rows("parts/tried.csv"), []
    for idea in dict.fromkeys(r["idea"] for r in found):
        of = chosen(found, idea=idea)
        lines.append([idea, str(len(of)), over_seeds(of, "contact_ssim"), over_seeds(of, "contact_psnr_db", 1), of[0]["kept"]])
    return table(["idea", "seeds", "contact SSIM", "PSNR dB", "kept"], lines)
