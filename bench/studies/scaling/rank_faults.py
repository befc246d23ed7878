#!/usr/bin/env python3
"""Seeded faults of trainings on several processes: rank_faults.py BUILD_DIR OUT_DIR [RUNS] [SEED].

Each run starts 2 or 4 ranks under mpirun and does one of: kill -9 of any rank at a random moment, a frozen rank
(SIGSTOP), a full disk (rank 0 may not write any more than 60 kB into a file), one rank with another option. It must
end with an error within 30 s of the fault and with at most one line of ours, and a resumed run, on another number of ranks, must give the bytes of an undisturbed one. Writes OUT_DIR/rank_faults.csv.
"""
import hashlib
import os
import pathlib
import random
import resource
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2]))
from source import source  # noqa: E402

MPIRUN = os.environ.get("MPIRUN", "mpirun")
LIMIT_S = 30
for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "OMPI_MCA_rmaps_base_oversubscribe"):
    os.environ[name] = "1"
os.environ["OMPI_MCA_hwloc_base_binding_policy"] = "none"


def options(out, data):
    return ["--data", data, "--out", out, "--timesteps", "32", "--latent", "3", "--scale", "2", "--batch", "8",
            "--stride", "4", "--epochs", "4", "--checkpoint-every", "5", "--threads", "1", "--quiet"]


def process_of(out, rank):
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/cmdline", "rb") as file:
                words = file.read().decode().split("\0")
            with open(f"/proc/{pid}/environ", "rb") as file:
                variables = file.read().decode(errors="replace").split("\0")
        except OSError:
            continue
        named = any(f"{name}={rank}" in variables for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK"))
        if words[0].endswith("supertac-train") and out in words and named:
            return int(pid)
    return None


def command(train, ranks, out, data, more=(), odd=None):
    words = [MPIRUN, "-n", str(ranks if odd is None else ranks - 1), train, *options(out, data), *more]
    return words if odd is None else words + [":", "-n", "1", train, *options(out, data), *more, *odd]


def disturb(process, kind, rank, out, moment):
    """Waits for the moment and does it; returns when, or None when the run was over before."""
    begin = time.monotonic()
    while time.monotonic() - begin < moment:
        if process.poll() is not None:
            return None
        time.sleep(0.005)
    pid = process_of(out, rank)
    if pid is None:
        return None
    if kind == "disk":
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (60_000, 60_000))
    else:
        os.kill(pid, signal.SIGKILL if kind == "kill" else signal.SIGSTOP)
    return time.monotonic()


def digest(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()[:16]


def fault_run(number, chance, train, folder, data, usual_s):
    kind = chance.choice(["kill", "kill", "freeze", "freeze", "disk", "option"])
    ranks = chance.choice([2, 4])
    rank = 0 if kind == "disk" else chance.randrange(ranks)
    moment = chance.uniform(0, usual_s)
    out = os.path.join(folder, f"run{number}.safetensors")
    odd = ["--beta", "0.5"] if kind == "option" else None
    words = command(train, ranks, out, data, ["--deadline", "20"], odd)
    begin = time.monotonic()
    with open(out + ".txt", "w") as text:
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=text)
    struck = begin if kind == "option" else disturb(process, kind, rank, out, moment)
    try:
        code = process.wait(timeout=300)
    except subprocess.TimeoutExpired:
        process.kill()
        code = "hangs"
    seconds = time.monotonic() - (struck or begin)
    with open(out + ".txt") as text:
        lines = [line for line in text if line.startswith("supertac")]
    state = out.replace(".safetensors", ".run/last.safetensors")
    over = os.path.exists(out)
    if not over:
        more = ["--resume", state] if os.path.exists(state) else ["--force"]
        subprocess.run(command(train, 6 - ranks, out, data, more), check=True, stderr=subprocess.DEVNULL)
    return {"run": number, "kind": kind if struck else kind + " (too late)", "ranks": ranks, "rank": rank,
            "moment_s": f"{moment:.2f}", "code": code, "seconds": f"{seconds:.1f}", "lines": len(lines),
            "in_time": struck is None or (code not in (0, "hangs") or over) and seconds <= LIMIT_S, "hash": digest(out), **source()}


def main():
    build, folder = sys.argv[1:3]
    runs, seed = (int(x) for x in (sys.argv[3:] + ["100", "1"][len(sys.argv) - 3:])[:2])
    train = os.path.join(os.path.abspath(build), "bin/supertac-train")
    os.makedirs(folder, exist_ok=True)
    data = os.path.join(folder, "data")
    if not os.path.exists(data):
        subprocess.run([train.replace("train", "simulate"), "--out", data, "--plates", "3_Bumps", "--speeds", "10",
                        "--passes", "1"], check=True, stdout=subprocess.DEVNULL)
    whole = os.path.join(folder, "whole.safetensors")
    begin = time.monotonic()
    subprocess.run(command(train, 4, whole, data, ["--force"]), check=True, stderr=subprocess.DEVNULL)
    usual_s = time.monotonic() - begin
    chance = random.Random(seed)
    bad = 0
    with open(os.path.join(folder, "rank_faults.csv"), "w") as table:
        for number in range(runs):
            row = fault_run(number, chance, train, folder, data, usual_s)
            if number == 0:
                table.write(",".join(row) + "\n")
            table.write(",".join(str(value) for value in row.values()) + "\n")
            table.flush()
            good = row["in_time"] and row["lines"] <= 1 and row["hash"] == digest(whole)
            bad += not good
            print("good" if good else "BAD", row, flush=True)
    print(f"{runs} runs, {bad} bad; an undisturbed run took {usual_s:.1f} s")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
