#!/usr/bin/env python3
"""What a step of a training on R processes takes: rank_model.py BIN RECORDINGS RESULTS.csv [ROUNDS].

    T(R, B) = h (a + c B / R) + S,    S = s in shared memory, e 2 (R - 1) G / rate over a link that all R share

a, c: the fixed part of a step and a window's, from one process with batches of 16 and 128; h: how much slower two
processes of this machine compute when both do, from a batch of 64 in shared memory, where the sum of the gradients takes
s = 0.75 ms (ordered_sum.csv); e: how much of a link's rate is used, from 200 Mbit/s. G is the size of the gradient.
Settings that were not fitted test it. Preset paper, one thread a process, the settings by turns. A machine's speed changes
from minute to minute, so every one of ROUNDS (6) is fitted and tested on its own, and medians over the rounds are given.

Then it is drawn beyond this machine: ranks on machines of their own (h = 1), each with a full-duplex link of its own and
LATENCY_S for a message, so S = 2 (1 - 1/R) G / rate + 2 log2(R) latency; the batch B for which R ranks are 80 % as
efficient as one with the same batch. Run as root: links are a loopback device in a network namespace, kept to a rate by tc.
"""
import csv
import math
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

GRADIENT_BITS = 8 * 4 * 537_521
SHARED_MEMORY_MS = 0.75
LATENCY_S = 20e-6
FITTED = [(1, 16, None), (1, 128, None), (2, 64, None), (2, 16, 200)]  # ranks, batch, Mbit/s (None: shared memory)
TESTED = [(1, 64, None), (2, 128, None), (2, 64, 400), (2, 128, 400)]
OPTIONS = ["--split", "none", "--epochs", "20", "--threads", "1", "--quiet", "--force", "--checkpoint-every", "1000000"]
ENVIRONMENT = os.environ | {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
                            "OMPI_MCA_hwloc_base_binding_policy": "none"}
OVER_TCP = {"OMPI_MCA_btl": "tcp,self", "OMPI_MCA_btl_tcp_if_include": "lo", "OMPI_MCA_oob_tcp_if_include": "lo"}


def step_ms(program, recordings, folder, ranks, batch, rate):
    """Milliseconds a step, from the first line of the log to the second."""
    out = pathlib.Path(folder) / f"r{ranks}b{batch}.safetensors"
    log = out.with_suffix(".run") / "log.csv"
    log.unlink(missing_ok=True)
    words = ["mpirun", "-n", str(ranks), program, "--data", recordings, "--out", out, "--batch", str(batch), *OPTIONS]
    link = f"tc qdisc replace dev lo root tbf rate {rate}mbit burst 128kb limit 64mb" if rate else "true"
    shell = ["unshare", "-n", "sh", "-ec", f'ip link set lo up; {link}; exec "$@"', "sh"]
    process = subprocess.Popen([*shell, *words], env=ENVIRONMENT | (OVER_TCP if rate else {}), stdout=subprocess.DEVNULL)
    limit = time.monotonic() + 300
    rows = []
    while len(rows) < 2:
        if process.poll() is not None or time.monotonic() > limit:
            raise SystemExit(f"rank_model.py: {ranks} ranks, batch {batch}: ended or took more than 300 s")
        time.sleep(0.2)
        if log.exists():
            with open(log) as file:
                rows = [row for row in csv.DictReader(file) if row["test_psnr_db"] is not None]  # whole lines
    process.send_signal(signal.SIGTERM)
    process.wait(60)
    (begin, first), (end, last) = [(float(row["time_s"]), int(row["step"])) for row in rows[:2]]
    return 1e3 * (end - begin) / (last - first)


def fit(measured):
    """a, c, h, e from the four settings of FITTED, each of which adds one of them."""
    (few, many, shared, linked), ms = [batch for _, batch, _ in FITTED], [measured[setting] for setting in FITTED]
    c = (ms[1] - ms[0]) / (many - few)
    a = ms[0] - few * c
    h = (ms[2] - SHARED_MEMORY_MS) / (a + c * shared / 2)
    e = (ms[3] - h * (a + c * linked / 2)) / (1e3 * 2 * GRADIENT_BITS / (FITTED[3][2] * 1e6))
    return a, c, h, e


def model_ms(a, c, h, e, ranks, batch, rate):
    if ranks == 1:
        return a + c * batch
    link = 1e3 * e * 2 * (ranks - 1) * GRADIENT_BITS / (rate * 1e6) if rate else SHARED_MEMORY_MS
    return h * (a + c * batch / ranks) + link


def efficient_batch(a, c, ranks, gbit):
    """The batch for which one process takes 0.8 R times as long as R processes, and the time of their step."""
    link = 1e3 * (2 * (1 - 1 / ranks) * GRADIENT_BITS / (gbit * 1e9) + 2 * math.log2(ranks) * LATENCY_S)
    batch = (0.8 * ranks * (a + link) - a) / (0.2 * c)
    return batch, a + c * batch / ranks + link


def main():
    binaries, recordings, results = sys.argv[1:4]
    rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 6
    seen = []  # of every round the fitted parameters, and by setting what was measured and what the model says
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(rounds):
            measured = {setting: step_ms(f"{binaries}/supertac-train", recordings, folder, *setting)
                        for setting in FITTED + TESTED}
            parameters = fit(measured)
            seen.append((parameters, {setting: (ms, model_ms(*parameters, *setting)) for setting, ms in measured.items()}))
            print(turn, *(f"{ms:.1f}/{model:.1f}" for ms, model in seen[-1][1].values()), file=sys.stderr)
    a, c, h, e = (statistics.median(values) for values in zip(*(parameters for parameters, _ in seen)))
    print(f"a {a:.2f} ms, c {c:.3f} ms, h {h:.3f}, e {e:.3f}")
    with open(results, "w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["kind", "ranks", "batch", "link_mbit", "measured_ms", "model_ms", "model_over_measured"])
        for setting in FITTED + TESTED:
            pairs = [both[setting] for _, both in seen]
            middle = [statistics.median(values) for values in zip(*((ms, model, model / ms) for ms, model in pairs))]
            writer.writerow(["fitted" if setting in FITTED else "tested", *setting[:2], setting[2] or "",
                             f"{middle[0]:.2f}", f"{middle[1]:.2f}", f"{middle[2]:.3f}"])
        for gbit in (1, 10, 100):
            for ranks in (2**k for k in range(1, 11)):
                batch, ms = efficient_batch(a, c, ranks, gbit)
                writer.writerow(["80 % efficient", ranks, math.ceil(batch), 1000 * gbit, "", f"{ms:.2f}", ""])


if __name__ == "__main__":
    main()
