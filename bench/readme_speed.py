#!/usr/bin/python3
"""Writes the figures of bench/results/{peers,streaming,linear_cost}.csv into README.md, between the lines
<!-- speed --> and <!-- /speed -->."""
import csv
import pathlib
import re

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[1]
TASKS = {"infer 1": "inference, batch 1", "infer 8": "inference, batch 8", "infer 64": "inference, batch 64",
         "train 1": "training step of 64 windows", "train 2": "the same on two threads"}


def rows(name):
    with open(ROOT / "bench/results" / name, newline="") as file:
        return list(csv.DictReader(file))


def time(us):
    us = float(us)
    return f"{us / 1000:.2f} ms" if us >= 1000 else f"{us:.0f} us"


def table():
    lines = ["| | SuperTac | compared with | | times as fast (95 % interval) | share of FMA peak |", "|---|---|---|---|---|---|"]
    for r in rows("peers.csv"):
        lines.append(f"| {TASKS[r['task']]} | {time(r['ours_us'])} | {r['peer']} | {time(r['peer_us'])} | "
                     f"{float(r['ratio']):.1f} ({float(r['ratio_low']):.1f} to {float(r['ratio_high']):.1f}) | "
                     f"{100 * float(r['ours_share']):.0f} % |")
    return "\n".join(lines)


def streaming():
    f = {r["figure"]: float(r["value"]) for r in rows("streaming.csv")}
    return (f"One window every millisecond for {f['windows'] / 1000:.0f} s: median {f['cpu_median_us']:.0f} us, p99.9 "
            f"{f['cpu_p99.9_us']:.0f} us of processor time ({f['wall_median_us']:.0f} and {f['wall_p99.9_us']:.0f} us on the "
            f"wall), {f['peak_resident_mb']:.0f} MB resident, first picture {f['ready_ms']:.0f} ms after the start of the process.")


def growth():
    def line(axis, x, factor=1.0):
        chosen = [r for r in rows("linear_cost.csv") if r["axis"] == axis]
        a, b = (np.array([float(r[key]) for r in chosen]) for key in (x, "us"))
        slope, intercept = np.polyfit(a, b * factor, 1)
        return slope, intercept, np.corrcoef(a, b)[0, 1]

    t, batch, width, train = (line("timesteps", "value"), line("batch", "value"), line("channels", "mmac"),
                              line("training_windows", "value", 1e-3))
    return (f"Cost grows linearly: {t[1]:.0f} us + {t[0]:.3f} us per sample of the window (r = {t[2]:.3f}), {batch[0]:.0f} us per "
            f"window of a batch (r = {batch[2]:.3f}), {width[0]:.1f} us per million multiply-adds from 8 to 96 channels "
            f"(r = {width[2]:.3f}), {train[0]:.2f} ms of training per window of the data set (r = {train[2]:.3f}).")


def section():
    parts = {"peers.csv": table, "streaming.csv": streaming, "linear_cost.csv": growth}
    return "\n\n".join(part() for name, part in parts.items() if (ROOT / "bench/results" / name).exists())


def main():
    readme = ROOT / "README.md"
    text = readme.read_text()
    new = f"<!-- speed -->\n{section()}\n<!-- /speed -->"
    changed, count = re.subn(r"<!-- speed -->.*<!-- /speed -->", lambda _: new, text, flags=re.DOTALL)
    if count != 1:
        raise SystemExit("readme_speed.py: README.md has no lines <!-- speed --> ... <!-- /speed -->")
    readme.write_text(changed)


if __name__ == "__main__":
    main()
