#!/usr/bin/env python3
"""What a ledger costs a training, and an audit of one of its twenty parts, in processor time of one thread.

    bench/studies/ledger_cost.py BIN RECORDINGS RESULTS.csv [PAIRS, 5] [options of supertac-train]

Trainings of one epoch without a ledger and with a line for every step take turns (A B B A ...); that is a hundred times
the lines of --ledger 100, since what that costs is less than a machine's speed varies from minute to minute. Then one
training of 20 epochs with --ledger 100 is audited by --segments 1 with PAIRS seeds, and with every instruction set of
this processor. Without options: preset tiny.
"""
import csv
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile


def seconds(program, *words, isa=None):
    """Processor time; exits where the program fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = dict(os.environ, SUPERTAC_ISA=isa) if isa else None
    done = subprocess.run([program, *map(str, words), "--threads", "1", "--quiet"], capture_output=True, text=True, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(done.stdout + done.stderr)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    programs, data, results = map(pathlib.Path, sys.argv[1:4])
    pairs = int(sys.argv[4]) if len(sys.argv) > 4 else 5
    options = sys.argv[5:] or ["--preset", "tiny"]
    rows = []

    def tell(what, run, time, percent):
        rows.append([what, run, f"{time:.2f}", f"{percent:.2f}"])
        print(*rows[-1], flush=True)

    with tempfile.TemporaryDirectory() as name:
        model = pathlib.Path(name) / "model.safetensors"

        def training(epochs, *more):
            return seconds(programs / "supertac-train", "--data", data, "--out", model, "--split", "trial", "--force", *options,
                           "--epochs", epochs, *more)

        def audit(seed, isa=None):
            return seconds(programs / "supertac-check", "training", model, "--data", data, "--segments", 1, "--seed", seed, isa=isa)

        for pair in range(pairs):
            times = {kept: training(1, *["--ledger", 1][:2 * kept]) for kept in ((False, True) if pair % 2 == 0 else (True, False))}
            tell("one epoch", pair + 1, times[False], 100)
            tell("and a line for every step", pair + 1, times[True], 100 * times[True] / times[False])
        whole = training(20, "--ledger", 100)
        tell("20 epochs with --ledger 100", 1, whole, 100)
        for seed in range(pairs):
            time = audit(seed)
            tell("audit of one part of twenty", seed + 1, time, 100 * time / whole)
        sets = json.loads(subprocess.run([programs / "supertac-check", "bits", "--json", "-"], capture_output=True, text=True,
                                         check=True).stdout)["paths"]
        for isa in dict.fromkeys(row["kernels"].split(",")[0] for row in sets):
            time = audit(pairs, isa)
            tell(f"audit with {isa}: the same bits", 1, time, 100 * time / whole)

    def median(what):
        return statistics.median(float(row[3]) for row in rows if row[0] == what)

    a_line_each = median("and a line for every step") - 100
    print(f"--ledger 100 costs {a_line_each / 100:.3f} %, an audit of one part of twenty takes "
          f"{median('audit of one part of twenty'):.1f} % of the training")
    with open(results, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["what", "run", "seconds", "percent_of_training"])
        table.writerows(rows)


if __name__ == "__main__":
    main()
