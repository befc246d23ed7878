#!/usr/bin/env python3
"""How far NumPy's recomputation of explained pictures is off: examples/recompute.py on windows spread over recordings.

    bench/studies/recompute.py BIN RECORDINGS RESULTS.csv WINDOWS MODEL ...

A line for each model: the worst step of all windows, as a share of its largest value, and how many steps had the same
bits throughout.
"""
import csv
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def steps(programs, model, recording, at, explained):
    done = subprocess.run([programs / "supertac-explain", model, "--recording", recording, "--at", f"{at:.3f}", "--out", explained,
                           "--force"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    text = subprocess.run([sys.executable, ROOT / "examples/recompute.py", explained, model], capture_output=True, text=True).stdout
    for line in text.splitlines():
        words = line.replace("  WRONG", "").split()
        if "[" in line and not line.startswith("array"):
            yield words[0], float(words[-3]), words[-2] == "100"


def main():
    if len(sys.argv) < 6:
        sys.exit(__doc__)
    programs, data = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    recordings, count = sorted(data.glob("*.safetensors")), int(sys.argv[4])
    with tempfile.TemporaryDirectory() as name, open(sys.argv[3], "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["model", "windows", "steps", "same_bits", "worst_step", "of_largest_value"])
        for model in map(pathlib.Path, sys.argv[5:]):
            found = [step for k in range(count) for step in
                     steps(programs, model, recordings[k * len(recordings) // count], 4 + 0.61 * (k % 8), f"{name}/e.safetensors")]
            worst = max(found, key=lambda step: step[1])
            row = [model.stem, count, len(found), sum(step[2] for step in found), worst[0], worst[1]]
            table.writerow(row)
            print(*row, flush=True)


if __name__ == "__main__":
    main()
