#!/usr/bin/env python3
"""Trains and measures a grid of models: accuracy against latency.
Usage:
  supertac-sweep --data DIR --out DIR [options] [options of supertac-train]

Each combination of the lists below is trained by supertac-train, which gets all other options, and scored by
supertac-evaluate into a row of DIR/sweep.csv; seeds change fastest. A sweep that was stopped goes on where it was.

  --data DIR         recordings to train and test on
  --out DIR          sweep.csv and models
  --preset A,B,...   recipes to start from: paper, tiny, frame (default: paper)
  --timesteps T,...  samples per window (default: the preset's)
  --latent LD,...    latent numbers per group of taxels (default: the preset's)
  --scale N,...      pictures N times as fine as the array (default: the preset's)
  --seeds N,...      of split, initial weights, order, noise (default: 0)
  --leave-out A,...  as supertac-train; each: every plate or group in turn, a row for each
  --limit N          score at most N test windows, evenly spread; 0 = all
  --history N        score only windows with N frames of their pass behind them: with the longest of --timesteps, all
                     models are judged on the same frames
  --threads N        worker threads
  --quiet            no progress bar and no remarks
  -h, --help         print this and exit
  --version          print version, commit, compiler and exit
"""
import argparse
import csv
import itertools
import json
import math
import pathlib
import signal
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
AXES = {"timesteps": "t", "latent": "l", "scale": "x"}
SCORES = {"windows": "windows", "ssim": "ssim", "psnr_db": "psnr_mean_db", "phase": "phase_correlation",
          "phase_floor": "phase_correlation_floor", "position_mm": "position_error_mm"}
COLUMNS = ["model", "preset", *AXES, "seed", "split", "left_out", *SCORES, *(f"all_{name}" for name in SCORES), "median_us",
           "p99_us", "parameters", "train_s", "steps", "commit", "recordings", "options"]


def fail(text, code=1):
    sys.exit((print(f"supertac-sweep: {text}", file=sys.stderr), code)[1])


def run(job, *words):
    """What a program beside this one prints; it has the signals and, where it fails, the last word."""
    child = subprocess.Popen([HERE / f"supertac-{job}", *words], stdout=subprocess.PIPE, text=True)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda signum, _: child.send_signal(signum))
    said, _ = child.communicate()
    if child.returncode:
        sys.exit(child.returncode if child.returncode > 0 else 128 - child.returncode)
    return said


def arguments():
    if {"-h", "--help"} & set(sys.argv):
        sys.exit(print(__doc__, end=""))
    if "--version" in sys.argv:
        sys.exit(print(run("train", "--version").replace("supertac-train", "supertac-sweep"), end=""))
    parser = argparse.ArgumentParser(prog="supertac-sweep", add_help=False, allow_abbrev=False)
    parser.error = lambda text: fail(f"{text} (see --help)", 2)
    for name in ("data", "out"):
        parser.add_argument(f"--{name}", required=True)
    for name, default in {"preset": "paper", "seeds": "0", "leave-out": "", "split": "", "limit": "0", "history": "0",
                          **dict.fromkeys(AXES, "")}.items():
        parser.add_argument(f"--{name}", default=default)
    parser.add_argument("--threads")
    parser.add_argument("--quiet", action="store_true")
    return parser.parse_known_args()


def each_of(folder, key):
    """The plates or groups of the recordings, each once."""
    names = set()
    for path in pathlib.Path(folder).glob("*.safetensors"):
        with open(path, "rb") as file:
            header = json.loads(file.read(int.from_bytes(file.read(8), "little")))
        names.add(header["__metadata__"].get(key, ""))
    if "" in names or not names:
        fail(f"--leave-out each: a recording in {folder} names no {key}", 2)
    return sorted(names)


def name_of(preset, *axes_and_more):
    """"paper_t256_l10_x4_s0", and what was left out; of the lengths those that were asked for."""
    *axes, left_out, seed = axes_and_more
    letters = [f"_{letter}{value}" for letter, value in zip(AXES.values(), axes) if value]
    name = "".join([preset, *letters, f"_s{seed}", f"_{left_out}" if left_out else ""])
    return "".join("-" if letter in ',/"\\\n' else letter for letter in name)


def measure(a, rest, models, recipe):
    """Trains what is not trained yet, scores it, and returns its row."""
    preset, *axes, left_out, seed = recipe
    name = name_of(*recipe)
    file, folder = models / f"{name}.safetensors", models / f"{name}.run"
    common = [*(["--threads", a.threads] if a.threads else []), *(["--quiet"] if a.quiet else [])]
    chosen = {"split": a.split, "leave-out": left_out, **dict(zip(AXES, axes))}
    options = [word for option, value in chosen.items() if value for word in (f"--{option}", value)]
    if not file.exists():
        state = folder / "last.safetensors"
        resume = ["--resume", state] if state.exists() else []
        run("train", "--data", a.data, "--out", file, "--preset", preset, "--seed", seed, "--force", *options, *resume, *common, *rest)
    scores = models / f"{name}.json"
    run("evaluate", "--model", file, "--data", a.data, "--limit", a.limit, "--history", a.history, "--json", scores, "--force", *common)
    scored, trained = json.loads(scores.read_text()), json.loads((folder / "settings.json").read_text())
    row = {"model": name, "preset": preset, "seed": seed, "split": scored["split"], "left_out": left_out,
           **{axis: trained["model"][axis] for axis in AXES}}
    for prefix, zone in (("", "contact"), ("all_", "all")):
        row |= {prefix + column: scored[zone][key] for column, key in SCORES.items()}
    return row | {**scored["latency"]["network"], "parameters": trained["parameters"], "steps": trained["steps"],
                  "train_s": trained["provenance"]["seconds"], "commit": trained["commit"]}


class Table(list):
    """sweep.csv. Figures that cannot be compared do not mix: `shared` is the same in all rows."""

    def __init__(self, path, **shared):
        self.path, self.shared = path, shared
        if not path.exists():
            return
        with open(path, newline="") as file:
            for number, cells in enumerate(csv.reader(file), 1):
                if len(cells) != len(COLUMNS) or (number == 1 and cells != COLUMNS):
                    fail(f"{path}: line {number}: expected the columns {','.join(COLUMNS)}; correct or remove the line, or choose "
                         "another --out")
                if number > 1:
                    self.append(dict(zip(COLUMNS, cells)))
        for key, now in shared.items():
            if self and self[0][key] != now:
                fail(f"{path}: this sweep began with {key} {self[0][key]}, now it is {now}; give the same, or choose another --out")

    def add(self, row):
        """The file is whole, whenever this is stopped."""
        row |= self.shared
        self.append({key: f"{value:.6f}" if isinstance(value, float) else "nan" if value is None else str(value)
                     for key, value in row.items()})
        new = self.path.with_suffix(".new")
        with open(new, "w", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self)
        new.replace(self.path)


def report(table):
    """Means over seeds and over what was left out; a configuration is of the front unless another is faster and better."""
    groups = {}
    for row in table:
        groups.setdefault(row["model"].rsplit(f"_s{row['seed']}", 1)[0], []).append(row)
    mean = lambda rows, key: sum(float(row[key]) for row in rows) / len(rows)
    best = -math.inf
    print("Pareto front, fastest first:")
    for name, rows in sorted(groups.items(), key=lambda entry: mean(entry[1], "median_us")):
        if (ssim := mean(rows, "ssim")) > best:
            best = ssim
            print(f"  {name}: SSIM {ssim:.3f}, {mean(rows, 'median_us'):.1f} us, {len(rows)} model(s)")
    if left_out := [row for row in table if row["left_out"]]:
        print("Each left out in turn, the worst first:")
        for row in sorted(left_out, key=lambda row: -1 if row["ssim"] == "nan" else float(row["ssim"])):
            print(f"  {row['model']}: SSIM {float(row['ssim']):.3f}")


def main():
    a, rest = arguments()
    lists = [a.preset.split(","), *(getattr(a, axis).split(",") for axis in AXES)]
    key = "group" if a.split == "group" else "plate"
    left_out = each_of(a.data, key) if a.leave_out == "each" else [a.leave_out]
    models = pathlib.Path(a.out) / "models"
    models.mkdir(parents=True, exist_ok=True)
    recordings = json.loads(run("info", a.data, "--json", "-"))["content"]
    table = Table(models.parent / "sweep.csv", recordings=recordings,
                  options=" ".join([*rest, "--split", a.split, "--limit", a.limit, "--history", a.history]))
    for recipe in itertools.product(*lists, left_out, a.seeds.split(",")):
        if all(row["model"] != name_of(*recipe) for row in table):
            table.add(measure(a, rest, models, recipe))
    report(table)


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        fail(f"{error.filename}: {error.strerror}")
