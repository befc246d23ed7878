#!/usr/bin/env python3
"""What a ledger costs a training, and an audit of one of its twenty parts, in processor time of one thread.

    bench/studies/ledger_cost.py BIN RECORDINGS RESULTS.csv [PAIRS, 3] [options of supertac-train]

Trainings without and with --ledger 100 take turns (A B B A ...); each ledger is audited by --segments 1 with another
seed, and the last besides with every instruction set of this processor. Without options: preset tiny, 4 epochs.
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
    pairs = int(sys.argv[4]) if len(sys.argv) > 4 else 3
    options = sys.argv[5:] or ["--preset", "tiny", "--epochs", "4"]
    rows = []
    with tempfile.TemporaryDirectory() as name:
        model = pathlib.Path(name) / "model.safetensors"

        def training(*more):
            return seconds(programs / "supertac-train", "--data", data, "--out", model, "--split", "trial", "--force", *options, *more)

        def audit(seed, isa=None):
            return seconds(programs / "supertac-check", "training", model, "--data", data, "--segments", 1, "--seed", seed, isa=isa)

        for pair in range(pairs):
            if pair % 2 == 0:
                plain = training()
            kept = training("--ledger", 100)
            audited = audit(pair)
            if pair % 2 == 1:
                plain = training()
            rows.append([pair + 1, f"{plain:.2f}", f"{kept:.2f}", f"{audited:.2f}", f"{100 * (kept / plain - 1):.2f}",
                         f"{100 * audited / kept:.2f}"])
            print(*rows[-1], flush=True)
        if pairs % 2 == 0:
            training("--ledger", 100)
        sets = {row["kernels"].split(",")[0]: 0 for row in json.loads(subprocess.run(
            [programs / "supertac-check", "bits", "--json", "-"], capture_output=True, text=True, check=True).stdout)["paths"]}
        for isa in sets:
            sets[isa] = audit(pairs, isa)
            print(f"audited with {isa}: the same, {sets[isa]:.1f} s", flush=True)
    rows.append(["median", *(f"{statistics.median(float(row[k]) for row in rows):.2f}" for k in range(1, 6))])
    with open(results, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["pair", "training_s", "with_ledger_s", "audit_s", "ledger_percent", "audit_percent"])
        table.writerows(rows)
    print(*rows[-1])


if __name__ == "__main__":
    main()
