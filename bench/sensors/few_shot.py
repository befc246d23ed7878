#!/usr/bin/env python3
"""Networks that saw simulated presses of a public set's sensor only, and with few groups of its truth.

    bench/sensors/few_shot.py BIN SETS_DIR OUT_DIR [SET ...]

Groups are parted as in real_sensors.py (seed 0). What a pooled array is by its making - its taxels are means, no skin
lies over them, they are linear and remember nothing - stands in the sensor's file; the rest is fitted to 1,600 frames
of the groups that are not tested, without their truth. 2,000 presses are simulated, and preset `frame` learns these.
Then 1, 3 and 10 groups of real truth are learnt with them, twice as often. Scores go to bench/results/few_shot.csv,
beside two methods that learn nothing.
"""
import json
import pathlib
import subprocess
import sys

import numpy as np

import baselines
import real_sensors
import sets
import supertac
from source import commit_of, keep, source

KEPT = real_sensors.BENCH / "results" / "few_shot.csv"
COLUMNS = ("set", "groups", "method", "frames", "ssim", "psnr_db", "peak_ssim", "peak_psnr_db", "contact_ssim",
           "contact_psnr_db", "command", "commit")
REAL = 2  # frames of real truth, repeated, for each simulated one
BODY = {"taxel_mm": 1, "skin_mm": 0.01, "knee": 1000, "hysteresis_s": 1e-4}
TOUCHED, PRESSES, EPOCHS, RATE_HZ = 1600, 2000, 4, 40  # sizes are in pitches: 1 mm stands for whichever it is


class Study:
    def __init__(self, programs, name, passes, out):
        self.programs, self.name, self.out, self.scale = pathlib.Path(programs), name, out, sets.SETS[name][1]
        self.train, self.test = passes
        self.out.mkdir(parents=True)

    def run(self, job, *words):
        command = [str(self.programs / f"supertac-{job}"), *map(str, words), "--quiet"]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode != 0:
            sys.exit(f"few_shot.py: this command failed, see above: {' '.join(command)}")

    def simulate(self):
        """Presses of a sensor like this one, its body fitted where its frames let that be done."""
        taxels = sets.pooled(np.concatenate([one.frames for one in self.train])[:TOUCHED], self.scale)
        count, rows, columns = taxels.shape
        signals = {"unit": "share of the largest", "pressed": "higher", "range": [0, 1]}
        sensor = {"name": self.name, "rows": rows, "columns": columns, "pitch_mm": 1, "rate_hz": RATE_HZ,
                  "body": BODY, "frame": {"kind": "text"}} | signals
        (self.out / "sensor.json").write_text(json.dumps(sensor))
        array = {"rows": rows, "columns": columns, "pitch_mm": 1, "channels": 1}
        supertac.write_recording(self.out / "touched.safetensors", supertac.Recording(
            time_s=np.arange(count) / RATE_HZ, volts=taxels.reshape(count, -1), array=array,
            metadata={"plate": "unknown", "pass": "1", "signals": json.dumps(signals)}))
        words = ["--sensor", self.out / "sensor.json", "--presses", PRESSES, "--scale", self.scale, "--out",
                 self.out / "simulated"]
        fit = ["--fit", self.out / "touched.safetensors"]
        if subprocess.run([str(self.programs / "supertac-simulate"), *map(str, words + fit)]).returncode != 0:
            print(f"{self.name}: not fitted, see above", flush=True)
            self.run("simulate", *words)

    def network(self, groups):
        """Contact and other scores of a network that has learnt simulated presses and so many groups of real truth."""
        where = self.out / f"groups_{groups}"
        names = sorted({one.group for one in self.train})
        chosen = np.random.default_rng(1).permutation(names)[:groups]
        real, simulated = [one for one in self.train if one.group in chosen], PRESSES * 6
        sets.write(real, self.scale, 1, where / "real")
        (where / "train").mkdir()
        for one in (self.out / "simulated").glob("*.safetensors"):
            (where / "train" / one.name).hardlink_to(one)
        frames = sum(len(one.frames) for one in real)
        for again in range(max(1, round(REAL * simulated / frames)) if real else 0):
            for one in (where / "real").glob("*.safetensors"):
                (where / "train" / f"{again}_{one.name}").hardlink_to(one)
        if not (self.out / "test").exists():
            sets.write(self.test, self.scale, 1, self.out / "test")
        model, outputs = where / "model.safetensors", where / "outputs.safetensors"
        self.run("train", "--data", where / "train", "--preset", "frame", "--split", "none", "--epochs", EPOCHS, "--scale", self.scale,
                 "--threads", 1, "--out", model)
        self.run("evaluate", "--model", model, "--data", self.out / "test", "--outputs", outputs, "--threads", 1)
        tensors, _ = supertac.files.read(outputs)
        return real_sensors.scores(self.name, tensors["output"], self.test)

    def rows(self):
        frames = sets.pooled(np.concatenate([one.frames for one in self.test]), self.scale)
        for method in (baselines.bicubic, baselines.back_projection):
            name = method.__name__.replace("_", "-")
            yield 0, name, real_sensors.scores(self.name, method(frames, self.scale), self.test)
        self.simulate()
        for groups in (0, 10, 3, 1):
            if groups <= len({one.group for one in self.train}):
                yield groups, "network", self.network(groups)


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    commit = commit_of(pathlib.Path(sys.argv[1]) / "supertac-train")
    for name in sys.argv[4:] or ("press", "mat", "sessions", "soles"):
        passes = real_sensors.split(list(sets.SETS[name][0](pathlib.Path(sys.argv[2]))), 0)
        for groups, method, figures in Study(sys.argv[1], name, passes, pathlib.Path(sys.argv[3]) / name).rows():
            row = {"set": name, "groups": groups, "method": method} | source() | {"commit": commit[:7]}
            row |= {key: f"{value:.4f}" if isinstance(value, float) else value for key, value in figures.items()}
            keep(KEPT, COLUMNS, ("set", "groups", "method"), row)
            print(*row.values(), flush=True)


if __name__ == "__main__":
    main()
