#!/usr/bin/env python3
"""Networks and classical methods on public sets of other sensors, of which people, objects or sessions were not seen.

    bench/sensors/real_sensors.py BIN SETS_DIR OUT_DIR [SET ...]

For each set and three seeds a fifth of the groups is kept away. On the others preset `frame` is trained twice: with split
`group`, which finds how wide the intervals must be on groups that a training has not seen, and on all of them. Where
frames belong together in time a window of 32 frames (`--optimizer muon --last-frame`) is trained as well. All methods
draw the same frames, those kept away. What is there is not trained again; scores go to bench/results/sensors.csv.
"""
import json
import pathlib
import shutil
import subprocess
import sys

import numpy as np

BENCH = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(BENCH), str(BENCH.parent / "python")]
import baselines  # noqa: E402
import sets  # noqa: E402
from source import commit_of, keep, source  # noqa: E402
from supertac import files  # noqa: E402

KEPT = BENCH / "results" / "sensors.csv"
COLUMNS = ("set", "seed", "method", "frames", "ssim", "psnr_db", "peak_ssim", "peak_psnr_db", "contact_ssim",
           "contact_psnr_db", "coverage", "command", "commit")
SEEDS = (0, 1, 2)
EPOCHS = {"press": 15, "soles": 40, "soles_x2": 40, "mat": 60, "covers": 20, "sessions": 10}
RATE = {"press": 55, "soles": 62.5, "covers": 100, "sessions": 100}


def split(passes, seed):
    """Part `seed` of the groups is kept away: of a random order a fifth, one at least, so that no two parts share any."""
    groups = np.random.default_rng(0).permutation(sorted({one.group for one in passes}))
    size = max(1, round(len(groups) / 5))
    away = set(groups[seed * size:(seed + 1) * size])
    return [p for p in passes if p.group not in away], [p for p in passes if p.group in away]


def scores(name, pictures, passes):
    """Of all frames, of those in contact (a truth that spans more than 0.05), and for presses of those within 20 % of the
    peak."""
    truth = np.concatenate([p.frames for p in passes])
    ssim, psnr = baselines.ssim(pictures, truth), baselines.psnr_db(pictures, truth)
    row = {"frames": len(truth), "ssim": ssim.mean(), "psnr_db": psnr.mean()}
    contact = np.ptp(truth, axis=(1, 2)) > 0.05
    row |= {"contact_ssim": ssim[contact].mean(), "contact_psnr_db": psnr[contact].mean()}
    if name == "press":
        sums = [p.frames.sum(axis=(1, 2)) for p in passes]
        peak = np.concatenate([s >= 0.8 * s.max() for s in sums])
        row |= {"peak_ssim": ssim[peak].mean(), "peak_psnr_db": psnr[peak].mean()}
    return row


class Study:
    def __init__(self, programs, folder, out):
        self.programs, self.folder, self.out = pathlib.Path(programs), pathlib.Path(folder), pathlib.Path(out)
        self.commit = commit_of(self.programs / "supertac-train")
        if self.commit.endswith("-dirty"):
            sys.exit("real_sensors.py: the programs were built from a changed tree: commit, build, start again")

    def run(self, job, *words):
        command = [str(self.programs / f"supertac-{job}"), *map(str, words), "--threads", "1", "--quiet"]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
            sys.exit(f"real_sensors.py: this command failed, see above: {' '.join(command)}")

    def network(self, name, seed, kind, passes, window, *words):
        """Trained on the first passes, with the factor that split `group` finds, and what it draws of the second."""
        scale, where = sets.SETS[name][1], self.out / f"{name}_{seed}_{kind}"
        if not where.exists():
            new = where.with_suffix(".new")
            shutil.rmtree(new, ignore_errors=True)
            for part, folder in zip(passes, ("train", "test")):
                sets.write(part, scale, window, new / folder)
            new.rename(where)
        words = [*words, "--timesteps", window, "--seed", seed, "--epochs", EPOCHS[name], "--scale", scale, "--force"]
        model, outputs, told, how = (where / file for file in ("model.safetensors", "outputs.safetensors", "scores.json", "how"))
        if not told.exists() or how.read_text() != f"{self.commit} {words}":
            first = where / "first.safetensors"
            self.run("train", "--data", where / "train", *words, "--split", "group", "--out", first)
            factor = files.read(first)[1]["interval_factor"]
            self.run("train", "--data", where / "train", *words, "--split", "none", "--interval-factor", factor, "--out", model)
            self.run("evaluate", "--model", model, "--data", where / "test", "--outputs", outputs, "--json", told, "--force")
            how.write_text(f"{self.commit} {words}")
        tensors, _ = files.read(outputs)
        truth = np.concatenate([one.frames for one in passes[1]])
        if tensors["output"].shape != truth.shape or np.abs(tensors["truth"] - truth).max() > 1e-6:
            sys.exit(f"real_sensors.py: {outputs}: these are not the frames that the other methods draw")
        return scores(name, tensors["output"], passes[1]) | {"coverage": json.loads(told.read_text())["trust"]["coverage"]}

    def frames(self, name, seed):
        read, scale, _ = sets.SETS[name]
        passes = split(list(read(self.folder)), seed)
        truths = [np.concatenate([one.frames for one in part]) for part in passes]
        frames = [sets.pooled(part, scale) for part in truths]
        yield "bicubic", scores(name, baselines.bicubic(frames[1], scale), passes[1])
        yield "back-projection", scores(name, baselines.back_projection(frames[1], scale), passes[1])
        yield "A+", scores(name, baselines.APlus(frames[0], truths[0], scale, seed=seed)(frames[1]), passes[1])
        yield "one frame", self.network(name, seed, "frame", passes, 1, "--preset", "frame")

    def windows(self, name, seed):
        read, _, in_time = sets.SETS[name]
        if in_time:
            yield "window", self.network(name, seed, "window", split(list(read(self.folder)), seed), 32, "--optimizer", "muon",
                                         "--last-frame", "--rate", RATE[name], "--scaling", "fixed", "--augment", "none")


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    study = Study(*sys.argv[1:4])
    unknown = set(sys.argv[4:]) - set(sets.SETS)
    if unknown:
        sys.exit(f"real_sensors.py: expected sets of {', '.join(sets.SETS)}, found {', '.join(unknown)}")
    for rows in (study.frames, study.windows):  # windows take longest
        for name in sys.argv[4:] or sets.SETS:
            for seed in SEEDS:
                for method, figures in rows(name, seed):
                    row = {"set": name, "seed": seed, "method": method} | source() | {"commit": study.commit[:7]}
                    row |= {key: f"{value:.4f}" if isinstance(value, float) else value for key, value in figures.items()}
                    keep(KEPT, COLUMNS, ("set", "seed", "method"), row)
                    print(*row.values(), flush=True)


if __name__ == "__main__":
    main()
