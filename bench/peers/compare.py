#!/usr/bin/python3
"""The same checkpoint in the engines that users would pick and in our code, turn by turn on one machine.

    bench/peers/compare.py MODEL [--bin BUILD/bin] [--pairs 15] [--out bench/results/speed/peers.csv]

First checks that all draw the same pictures, up to the precision of each. Then times them alternately (A B A B ...) and
prints medians of the paired ratios with a 95 % interval (order statistics). One-thread figures are processor time, which
other programs on the machine do not add to; training on two threads is time on the wall, and means something on an idle
machine only. `share` is of the FMA peak measured between our calls of the same pair; multiply-adds count padding as data.
Needs PyTorch; what else of requirements.txt is not installed is skipped.
"""
import argparse
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

# PyTorch frees its activations after every call; by default the C library gives such blocks back to the system, and on
# some machines getting them again takes longer than the network. Ours keeps its memory; let PyTorch do so, in large pages.
KEEP_MEMORY = ("glibc.malloc.hugetlb=1:glibc.malloc.mmap_max=0:glibc.malloc.trim_threshold=1000000000:"
               "glibc.malloc.top_pad=100000000")
# One thread means one: torch.set_num_threads alone leaves a second one spinning in some builds.
ENVIRONMENT = {"GLIBC_TUNABLES": KEEP_MEMORY, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
if any(os.environ.get(name) != value for name, value in ENVIRONMENT.items()):
    os.execve(sys.executable, [sys.executable, *sys.argv], os.environ | ENVIRONMENT)

import numpy as np  # noqa: E402
import torch  # noqa: E402
import torch.nn.functional as F  # noqa: E402

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / folder) for folder in ("bench", "bench/peers", "python")]
import engines  # noqa: E402
import supertac  # noqa: E402
from source import write  # noqa: E402
from supertac.torch_model import loss_terms  # noqa: E402

TRAINING_BATCH = 64


class Drawing(torch.nn.Module):
    """The package's network on windows as it sees them: [N,T,16] -> [N,1 or 2,S,S], the picture and its predicted error."""

    def __init__(self, path):
        super().__init__()
        model = supertac.load_model(path)
        self.network, self.settings = model.to_torch(), model.settings

    def forward(self, windows):
        return torch.stack([plane for plane in self.network.draw(windows)[:2] if plane is not None], 1)


def count_macs(call):
    """Multiply-adds of the convolutions and linear layers that `call` runs, padding counted as data."""
    total, originals = 0, {}

    def counted(name):
        def run(x, w, *rest, **options):
            nonlocal total
            y = originals[name](x, w, *rest, **options)
            positions = x if "transpose" in name else y
            total += w.numel() * positions.numel() // positions.shape[0] // (w.shape[0])
            return y

        return run

    for name in ("linear", "conv1d", "conv2d", "conv_transpose1d", "conv_transpose2d"):
        originals[name] = getattr(F, name)
        setattr(F, name, counted(name))
    try:
        call()
    finally:
        for name, original in originals.items():
            setattr(F, name, original)
    return total


class Ours:
    """peers_ours as a child process that takes orders."""

    def __init__(self, program, model, windows):
        self.process = subprocess.Popen([program, model, windows], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __call__(self, order):
        self.process.stdin.write(order + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit("compare.py: peers_ours stopped, see above")
        return answer.split()

    def timed(self, order, seconds):
        return [float(word) for word in self(f"{order} {seconds}")]


def timed(call, seconds):
    """Median processor time and median wall time of a call, over about so many seconds."""
    call()
    cpu, wall = [], []
    start = time.perf_counter()
    while time.perf_counter() - start < seconds or len(cpu) < 3:
        wall_begin, cpu_begin = time.perf_counter(), time.process_time()
        call()
        cpu.append(time.process_time() - cpu_begin)
        wall.append(time.perf_counter() - wall_begin)
    return statistics.median(cpu), statistics.median(wall)


def interval(values):
    """Median and the narrowest pair of order statistics that covers it with at least 95 %."""
    ordered, n = sorted(values), len(values)
    outside, k = 0.0, 0
    while k < n // 2:
        outside += math.comb(n, k) / 2**n
        if 2 * outside > 0.05:
            break
        k += 1
    return statistics.median(ordered), ordered[max(0, k - 1)], ordered[min(n - 1, n - k)]


def training_peer(model, windows):
    network, adam = model.network, torch.optim.Adam(model.parameters(), lr=1e-5)
    eps = torch.randn(4, len(windows), model.settings["latent"])
    with torch.no_grad():
        truth = model(windows)[:, 0].clamp(0, 1)

    def step():
        adam.zero_grad()
        loss_terms(network.training_outputs(windows, eps), truth)["total"].backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1)
        adam.step()

    return step


def pair(ours, order, peers, pairs, seconds, macs):
    """One row per peer; ours and the peers take turns `pairs` times."""
    times = {name: [] for name in peers}
    own = []
    for _ in range(pairs):
        own.append(ours.timed(order, seconds))
        for name, call in peers.items():
            times[name].append(timed(call, seconds))
    rows = []
    for name in peers:
        ratio = interval([t[0] / o[0] for t, o in zip(times[name], own)])
        rows.append({
            "task": order, "peer": name, "pairs": pairs,
            "ours_us": 1e6 * statistics.median(o[0] for o in own),
            "peer_us": 1e6 * statistics.median(t[0] for t in times[name]),
            "ratio": ratio[0], "ratio_low": ratio[1], "ratio_high": ratio[2],
            "wall_ratio": statistics.median(t[1] / o[1] for t, o in zip(times[name], own)),
            "ours_share": statistics.median(2e-9 * macs / o[0] / o[2] for o in own),
            "peer_share": statistics.median(2e-9 * macs / t[0] / o[2] for t, o in zip(times[name], own)),
            "mmac": macs / 1e6, "peak_gflops": statistics.median(o[2] for o in own),
        })
    return rows


def two_threads(ours, pairs, seconds, macs):
    """Two threads against one, on the wall."""
    runs = [(ours.timed("train 1", seconds), ours.timed("train 2", seconds)) for _ in range(pairs)]
    ratio = interval([one[1] / two[1] for one, two in runs])
    peak = statistics.median(two[2] for _, two in runs)
    two_wall, one_wall = (statistics.median(r[i][1] for r in runs) for i in (1, 0))
    return {"task": "train 2", "peer": "ours on one thread", "pairs": pairs, "ours_us": 1e6 * two_wall,
            "peer_us": 1e6 * one_wall, "ratio": ratio[0], "ratio_low": ratio[1], "ratio_high": ratio[2],
            "wall_ratio": ratio[0], "ours_share": 2e-9 * macs / two_wall / (2 * peak),
            "peer_share": 2e-9 * macs / one_wall / peak, "mmac": macs / 1e6, "peak_gflops": peak}


def check_pictures(ours, model, windows, folder):
    ours(f"pictures {folder}/pictures.safetensors")
    pictures = supertac.read(f"{folder}/pictures.safetensors")[0]["pictures"]
    with torch.no_grad():
        difference = np.abs(model(windows)[:, 0].numpy() - pictures).max()
        inference = count_macs(lambda: model(windows[:1]))
        eps = torch.zeros(4, 1, model.settings["latent"])
        forward = count_macs(lambda: model.network.training_outputs(windows[:1], eps))
    print(f"pictures differ by at most {difference:.1e}; {inference / 1e6:.2f} MMAC a window")
    if not difference < 1e-4:
        sys.exit("compare.py: the two do not compute the same; nothing was timed")
    return inference, 3 * forward, pictures  # as much again for each of the two gradients


def differences(calls, pictures):
    """Name -> the largest difference from our pictures."""
    found = {name: float(np.abs(np.asarray(call())[:, 0] - pictures).max()) for name, call in calls.items()}
    for name, difference in found.items():
        if not difference < 1e-4:
            sys.exit(f"compare.py: pictures of {name} differ by up to {difference:.1e}; nothing was timed")
    return found


def arguments(about, name):
    """A parser of what all measurements of this folder take; `name` is that of the CSV."""
    parser = argparse.ArgumentParser(description=about.splitlines()[0])
    parser.add_argument("--bin", default=ROOT / "build-dev/bin", help="where our programs are (-DSUPERTAC_BENCH=ON)")
    parser.add_argument("--out", default=ROOT / f"bench/results/speed/{name}.csv")
    return parser


def opened(options, folder):
    """PyTorch's network and ours, which were seen to draw the same: ours, the network, windows, multiply-adds, pictures."""
    torch.set_num_threads(1)
    torch.manual_seed(1)
    model = Drawing(options.model)
    windows = torch.rand(TRAINING_BATCH, model.settings["timesteps"], 16)
    supertac.write(f"{folder}/windows.safetensors", {"windows": windows.numpy()})
    ours = Ours(pathlib.Path(options.bin) / "peers_ours", options.model, f"{folder}/windows.safetensors")
    return ours, model, windows, *check_pictures(ours, model, windows, folder)


def keep(path, rows):
    """The rows as a CSV, with the engines' versions."""
    versions = engines.versions()
    write(path, [row | {"versions": versions} for row in rows])


def main():
    parser = arguments(__doc__, "peers")
    parser.add_argument("model")
    parser.add_argument("--pairs", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=0.2, help="of each turn")
    parser.add_argument("--compile", action="store_true", help="also torch.compile, which takes minutes to get ready")
    options, rows = parser.parse_args(), []
    with tempfile.TemporaryDirectory() as folder:
        ours, model, windows, inference, training, pictures = opened(options, folder)
        with torch.no_grad():
            for batch in (1, 8, 64):
                peers = engines.inference(model, windows[:batch], folder, options.compile)
                found = differences(peers, pictures[:batch])
                for row in pair(ours, f"infer {batch}", peers, options.pairs, options.seconds, batch * inference):
                    rows.append(row | {"difference": found[row["peer"]]})
        step = training_peer(model, windows)
        steps = {"pytorch eager": step} | ({"torch.compile": torch.compile(step)} if options.compile else {})
        rows += pair(ours, "train 1", steps, options.pairs, options.seconds, TRAINING_BATCH * training)
        rows.append(two_threads(ours, options.pairs, options.seconds, TRAINING_BATCH * training))
    keep(options.out, rows)
    print(f"{'task':9} {'against':19} {'ours us':>9} {'peer us':>9} {'ratio':>6} {'95 % interval':>15} {'share':>6}")
    for r in rows:
        print(f"{r['task']:9} {r['peer']:19} {r['ours_us']:9.1f} {r['peer_us']:9.1f} {r['ratio']:6.2f} "
              f"{r['ratio_low']:6.2f} .. {r['ratio_high']:5.2f} {100 * r['ours_share']:5.0f} %")


if __name__ == "__main__":
    main()
