#!/usr/bin/env python3
"""How fast several processes train: rank_speed.py BIN BIN_WITHOUT_MPI RECORDINGS RESULTS.csv [PAIRS].

By turns the build without MPI, the build with it on one process, and on two processes, one thread each, train one epoch.
Milliseconds a step are those from the first line of the log to the last; no test falls between. The bytes of all models
must be the same. mpirun leaves the processors to the system.
"""
import csv
import hashlib
import os
import pathlib
import subprocess
import sys
import tempfile

OPTIONS = ["--split", "none", "--stride", "6", "--epochs", "1", "--threads", "1", "--quiet"]
ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                            "OMPI_MCA_hwloc_base_binding_policy": "none"}


def train(words, recordings, folder):
    """Milliseconds a step, steps, and the hash of the model's values (its metadata name the build)."""
    out = pathlib.Path(folder) / "model.safetensors"
    subprocess.run([*words, "--data", recordings, "--out", out, "--force", *OPTIONS], env=ENVIRONMENT, check=True,
                   stdout=subprocess.DEVNULL)
    with open(out.with_suffix(".run") / "log.csv") as file:
        rows = [(float(row["time_s"]), int(row["step"])) for row in csv.DictReader(file)]
    (begin, first), (end, last) = rows[0], rows[-1]
    model = out.read_bytes()
    values = model[8 + int.from_bytes(model[:8], "little"):]
    return 1e3 * (end - begin) / (last - first), last - first, hashlib.sha256(values).hexdigest()[:16]


def main():
    binaries, without, recordings, results = sys.argv[1:5]
    pairs = int(sys.argv[5]) if len(sys.argv) > 5 else 9
    program = f"{binaries}/supertac-train"
    runs = {"no MPI": [f"{without}/supertac-train"], "1": ["mpirun", "-n", "1", program], "2": ["mpirun", "-n", "2", program]}
    with open(results, "w") as file, tempfile.TemporaryDirectory() as folder:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["pair", "ranks", "ms_per_step", "steps", "hash"])
        first = None
        for pair in range(pairs):
            for name in list(runs)[:: 1 if pair % 2 == 0 else -1]:
                took, steps, digest = train(runs[name], recordings, folder)
                if digest != (first := first or digest):
                    raise SystemExit(f"rank_speed.py: {name}: model {digest}, the first was {first}")
                writer.writerow([pair, name, f"{took:.3f}", steps, digest])
                file.flush()
                print(pair, name, f"{took:.3f} ms", digest, file=sys.stderr)


if __name__ == "__main__":
    main()
