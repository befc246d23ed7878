#!/usr/bin/python3
"""How long the slowest pictures take: each of a million, one by one on one core, in our code and in other engines.

    bench/peers/tail.py MODEL [--bin BUILD/bin] [--pictures 1000000] [--out bench/results/speed/tail.csv]

Twice: with nothing else running, and beside a compiler on the other cores. Engines take turns of a fiftieth each. What
the machine itself adds is measured by additions that need no memory and take about as long as a picture ("no network").
Other engines are called from Python, whose collector is switched off. Needs what compare.py needs.
"""
import functools
import gc
import os
import resource
import subprocess
import sys
import tempfile
import time

import compare  # restarts with one thread and memory that is kept
import engines
import numpy as np
import supertac
import torch

TURNS = 50
WARM_UP = 100
COMPILER = f"while :; do c++ -std=c++20 -O2 -I{compare.ROOT} -c {compare.ROOT}/models/networks/supertac_model.cpp -o /dev/null; done"


def page_faults():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_minflt + usage.ru_majflt


def each(call, count):
    """The seconds of each call, and the page faults of all."""
    seconds = np.ones(count, np.float32)
    for _ in range(WARM_UP):
        call()
    before = page_faults()
    for i in range(count):
        begin = time.perf_counter()
        call()
        seconds[i] = time.perf_counter() - begin
    return seconds, page_faults() - before


def each_of_ours(ours, order, folder, count):
    """The same, measured by our program."""
    file = f"{folder}/{order}.safetensors"
    faults = int(ours(f"{order} {count} {file}")[0])
    return supertac.read(file)[0]["seconds"], faults


def measured(load, what, pictures):
    """One row for each of `what`, functions of a count, which take turns."""
    found = {name: [] for name in what}
    for turn in range(TURNS):
        for name, one in what.items():
            found[name].append(one(pictures // TURNS))
        print(f"\r{load}: {100 * (turn + 1) // TURNS} %", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    for name, turns in found.items():
        us = 1e6 * np.concatenate([seconds for seconds, _ in turns])
        p50, p99, p999 = np.percentile(us, (50, 99, 99.9))
        yield {"load": load, "engine": name, "pictures": len(us), "p50_us": f"{p50:.1f}", "p99_us": f"{p99:.1f}",
               "p99.9_us": f"{p999:.1f}", "worst_us": f"{us.max():.0f}", "above_1_ms": int((us > 1000).sum()),
               "page_faults": sum(faults for _, faults in turns)}


def main():
    parser = compare.arguments(__doc__, "tail")
    parser.add_argument("model")
    parser.add_argument("--pictures", type=int, default=1_000_000)
    options, rows = parser.parse_args(), []
    *others, own_core = sorted(os.sched_getaffinity(0))
    if not others or options.pictures < TURNS:
        sys.exit(f"tail.py: expected two cores and at least {TURNS} pictures")
    os.sched_setaffinity(0, {own_core})
    with tempfile.TemporaryDirectory() as folder, torch.no_grad():
        ours, model, windows, _, _, pictures = compare.opened(options, folder)
        calls = engines.inference(model, windows[:1], windows, folder, False)
        compare.differences(calls, pictures[:1])
        what = {name: functools.partial(each_of_ours, ours, order, folder)
                for name, order in (("ours", "each"), ("no network", "spin"))}
        what |= {name: functools.partial(each, call) for name, call in calls.items() if name in ("onnx runtime", "openvino", "mnn")}
        gc.collect()
        gc.disable()
        rows += measured("idle", what, options.pictures)
        compilers = [subprocess.Popen(["taskset", "-c", str(core), "sh", "-c", COMPILER], start_new_session=True) for core in others]
        try:
            rows += measured("compiler", what, options.pictures)
        finally:
            for compiler in compilers:
                os.killpg(compiler.pid, 9)
    compare.keep(options.out, rows)
    for row in rows:
        print(*row.values(), sep=", ")


if __name__ == "__main__":
    main()
