"""What the commands of this folder share: options, recordings, trained models, and what is kept of them.

Models learn from four plates of the paper at 100 Hz by Muon, those of preset `tiny` for about 600 steps, those of preset
`paper`, whose larger pictures need them, for 1,200 at half the rate: enough to compare settings, not for the best
picture. What is there is not made again.
"""
import argparse
import csv
import importlib.util
import pathlib
import subprocess
import sys

BENCH = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(BENCH))
import source  # noqa: E402
from tables import rows, table  # noqa: E402

SPLITS = ("trial", "window")
PLATES = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"
PIXELS = {"epochs": 10, "learning_rate": 0.004}
SCORES = ("windows", "ssim", "psnr_db", "phase", "phase_floor", "position_mm", "median_us")


class Study:
    """One item: its options from the command line, and the folder that keeps its CSV and pictures."""

    def __init__(self, about, tests=False):
        """`tests`: whether it ends with tests of significance."""
        parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
        where = parser.add_mutually_exclusive_group(required=True)
        where.add_argument("--text", metavar="TEXT_DIR", help="the authors' recordings, <plate>/<trial>/<pass>.txt")
        where.add_argument("--simulated", action="store_true", help="rehearse on few simulated passes and short trainings")
        parser.add_argument("--bin", default="build/bin", help="folder of the programs (default: %(default)s)")
        parser.add_argument("--out", default="out/paper", help="recordings and models (default: %(default)s)")
        parser.add_argument("--seeds", default="0,1,2,3,4", help="of the trainings (default: %(default)s)")
        parser.add_argument("--so-far", action="store_true", help="train nothing: what there is by now")
        options = parser.parse_args()
        if missing := [name for name in ("numpy", "scipy") if tests and importlib.util.find_spec(name) is None]:
            sys.exit(f"{pathlib.Path(sys.argv[0]).name}: the tests of significance need {' and '.join(missing)}: "
                     f"install python3-{' python3-'.join(missing)}")
        self.so_far = options.so_far
        self.simulated, self.bin, self.seeds = options.simulated, pathlib.Path(options.bin), options.seeds.split(",")
        self.out = pathlib.Path(options.out + ("_simulated" if self.simulated else "")).resolve()
        self.kept = self.out if self.simulated else BENCH / "results" / "paper"
        self.data = self.out / "recordings"
        for folder in (self.out, self.kept):
            folder.mkdir(parents=True, exist_ok=True)
        if self.simulated:
            self.seeds = self.seeds[:2]
        if not self.data.exists() and self.simulated:
            self.run("simulate", "--plates", PLATES, "--speeds", 10, "--passes", 2, "--out", self.data)
        elif not self.data.exists():
            self.run("import", options.text, "--out", self.data)

    def run(self, job, *words):
        command = [str(self.bin / f"supertac-{job}"), *map(str, words)]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
            sys.exit(f"{pathlib.Path(sys.argv[0]).name}: this command failed, see above: {' '.join(command)}")

    def sweep(self, folder, preset, history=0, epochs=5, learning_rate=0.008, **axes):
        """Trains the grid on both splits; one row for each model, with scores of its test windows in contact."""
        grid = [word for axis, values in axes.items() for word in (f"--{axis}", ",".join(map(str, values)))]
        length = {"stride": 16, "epochs": 2, "limit": 200} if self.simulated else {"stride": 4, "epochs": epochs, "limit": 1500}
        length |= {"optimizer": "muon", "learning-rate": learning_rate}
        pace = [word for option, value in length.items() for word in (f"--{option}", value)]
        found = []
        for split in SPLITS:
            where = self.out / f"{folder}_{split}"
            if not self.so_far:
                self.run("sweep", "--data", self.data, "--plates", PLATES, "--preset", preset, "--rate", 100, *pace,
                         "--history", history, "--split", split, *augment(split), "--seeds", ",".join(self.seeds), "--threads", 1,
                         "--out", where, *grid)
            with open(where / "sweep.csv", newline="") as file:  # other items may have added to it
                found += [row for row in csv.DictReader(file) if row["seed"] in self.seeds and
                          all(row[axis] in map(str, values) for axis, values in axes.items())]
        return found

    def models(self, split):
        """The models of 16x16 pictures, by seed."""
        return [self.out / f"pixels_{split}" / "models" / f"paper_x4_s{seed}.safetensors" for seed in self.seeds]

    def pictures(self, split):
        """The folder of pictures that the first seed's network draws of its test windows."""
        folder = self.out / f"pictures_{split}_{self.seeds[0]}"
        if not folder.exists():
            self.run("evaluate", "--model", self.models(split)[0], "--data", self.data, "--limit", 200, "--pictures", folder)
        return folder

    def keep(self, name, lines):
        source.write(self.kept / f"{name}.csv", lines)

    def test(self, name):
        """Tests of significance on NAME.csv, where it has several seeds; needs python3-scipy."""
        import significance
        for line in significance.write(self.kept / f"{name}.csv"):
            print(*line.values(), sep=", ")

    def keep_sweep(self, name, models, *settings):
        self.keep(name, [{key: row[key] for key in ("split", *settings, "seed", *SCORES)} | {"programs": row["commit"][:7]}
                         for row in models])


def significance_table(name, folder="paper"):
    """What NAME_tests.csv says of the two splits."""
    lines = [[f"`{r['split']}`", r["compared"], r["test"], r["difference"], str(r["seeds"]), r["p"]]
             for r in rows(f"{folder}/{name}_tests.csv") if r["split"] in SPLITS]
    return table(["split", "compared", "test", "SSIM", "seeds", "p"], lines)


def augment(split):
    """Random gains, offsets and noise are for unseen trials."""
    return ["--augment", "none"] if split == "window" else []


def splits(models):
    return {split: [row for row in models if row["split"] == split] for split in SPLITS}
