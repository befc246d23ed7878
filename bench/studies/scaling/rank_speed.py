#!/usr/bin/env python3
"""How fast several processes train: rank_speed.py BIN BIN_WITHOUT_MPI RECORDINGS RESULTS.csv [PAIRS].

By turns the build without MPI, the build with it on one process, on two processes, and two trainings that know nothing
of each other, each with half the batch, train one epoch, one thread each. The last is what this machine's two processors
can give at best: whatever two ranks take longer than it, they take for being two ranks.
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

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2]))
from source import source  # noqa: E402

OPTIONS = ["--split", "none", "--stride", "6", "--epochs", "1", "--threads", "1", "--quiet"]
ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                            "OMPI_MCA_hwloc_base_binding_policy": "none"}


def steps_of(log):
    """Milliseconds a step, and steps."""
    with open(log) as file:
        rows = [(float(row["time_s"]), int(row["step"])) for row in csv.DictReader(file)]
    (begin, first), (end, last) = rows[0], rows[-1]
    return 1e3 * (end - begin) / (last - first), last - first


def train(words, recordings, folder):
    """Milliseconds a step, steps, and the hash of the model's values (its metadata name the build)."""
    out = pathlib.Path(folder) / "model.safetensors"
    subprocess.run([*words, "--data", recordings, "--out", out, "--force", *OPTIONS], env=ENVIRONMENT, check=True,
                   stdout=subprocess.DEVNULL)
    model = out.read_bytes()
    values = model[8 + int.from_bytes(model[:8], "little"):]
    return *steps_of(out.with_suffix(".run") / "log.csv"), hashlib.sha256(values).hexdigest()[:16]


def train_apart(program, recordings, folder):
    outs = [pathlib.Path(folder) / f"apart{i}.safetensors" for i in (0, 1)]
    both = [subprocess.Popen([program, "--data", recordings, "--out", out, "--force", "--batch", "32", *OPTIONS],
                             stdout=subprocess.DEVNULL) for out in outs]
    if any([process.wait() for process in both]):
        raise SystemExit("rank_speed.py: a training ended with an error")
    (one, steps), (other, _) = [steps_of(out.with_suffix(".run") / "log.csv") for out in outs]
    return (one + other) / 2, steps, ""


def main():
    binaries, without, recordings, results = sys.argv[1:5]
    pairs = int(sys.argv[5]) if len(sys.argv) > 5 else 9
    program = f"{binaries}/supertac-train"
    alone = f"{without}/supertac-train"
    runs = {"no MPI": [alone], "1": ["mpirun", "-n", "1", program], "2": ["mpirun", "-n", "2", program], "2 apart": []}
    with open(results, "w") as file, tempfile.TemporaryDirectory() as folder:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["pair", "ranks", "ms_per_step", "steps", "hash", *source()])
        first = None
        for pair in range(pairs):
            for name in list(runs)[:: 1 if pair % 2 == 0 else -1]:
                work = (train, runs[name]) if runs[name] else (train_apart, alone)
                took, steps, digest = work[0](work[1], recordings, folder)
                if digest and digest != (first := first or digest):
                    raise SystemExit(f"rank_speed.py: {name}: model {digest}, the first was {first}")
                writer.writerow([pair, name, f"{took:.3f}", steps, digest, *source().values()])
                file.flush()
                print(pair, name, f"{took:.3f} ms", digest, file=sys.stderr)


if __name__ == "__main__":
    main()
