#!/usr/bin/python3
"""How much faster more threads train, beside what the machine can give.

    bench/peers/threads.py MODEL [--bin BUILD/bin] [--threads 1,2,4,8,16] [--out bench/results/speed/threads.csv]

Time on the wall of a training step on so many threads, over that on one, for batches of 64 and of 128 windows. `apart` are
as many trainings on one thread each that run at the same time and share nothing: how many times as much they do together
as one alone. What they lack, cores lack that share caches, memory or an arithmetic unit. Medians over rounds, in each of
which all take turns. The machine should do nothing else. Needs what compare.py needs.
"""
import os
import pathlib
import tempfile
from concurrent.futures import ThreadPoolExecutor

import compare  # restarts with one thread
import numpy as np
import supertac
from source import write

BATCHES = (64, 128)


def steps_per_second(process, threads, batch, seconds):
    return 1 / float(process(f"train {threads} {seconds} {batch}")[1])


def one_round(processes, batch, counts, seconds):
    """Threads -> steps a second of one training on all of them, of that many trainings apart."""
    found = {}
    for threads in counts:
        together = steps_per_second(processes[0], threads, batch, seconds)
        with ThreadPoolExecutor(threads) as pool:
            apart = sum(pool.map(lambda process: steps_per_second(process, 1, batch, seconds), processes[:threads]))
        found[threads] = together, apart
    return found


def main():
    parser = compare.arguments(__doc__, "threads")
    parser.add_argument("model")
    parser.add_argument("--threads", default="1,2,4,8,16", help="those above the machine's are left out")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("--seconds", type=float, default=0.5, help="of each turn")
    options = parser.parse_args()
    counts = [int(word) for word in options.threads.split(",") if int(word) <= os.cpu_count()]
    samples = supertac.load_model(options.model).settings["timesteps"]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        windows = f"{folder}/windows.safetensors"
        supertac.write(windows, {"windows": np.zeros((1, samples, 16), np.float32)})
        program = pathlib.Path(options.bin) / "peers_ours"
        processes = [compare.Ours(program, options.model, windows) for _ in range(max(counts))]
        for batch in BATCHES:
            rounds = [one_round(processes, batch, counts, options.seconds) for _ in range(options.rounds)]
            for threads in counts:
                row = {"batch": batch, "threads": threads, "rounds": options.rounds,
                       "step_ms": compare.interval([1e3 / r[threads][0] for r in rounds])[0]}
                for i, name in enumerate(("together", "apart")):
                    times = compare.interval([r[threads][i] / r[1][0] for r in rounds])
                    row |= {name: times[0], f"{name}_low": times[1], f"{name}_high": times[2]}
                rows.append(row)
                print(f"batch {batch:3}, {threads:2} threads: {row['step_ms']:7.2f} ms a step, {row['together']:5.2f} times one; "
                      f"{threads:2} trainings apart {row['apart']:5.2f} times")
    write(options.out, rows)


if __name__ == "__main__":
    main()
