#!/usr/bin/python3
"""Writes the figures of bench/results/{peers,streaming,linear_cost,real_recordings}.csv into README.md, between the lines
<!-- speed --> and <!-- /speed -->, and <!-- accuracy --> and <!-- /accuracy -->."""
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


def speed():
    parts = {"peers.csv": table, "streaming.csv": streaming, "linear_cost.csv": growth}
    return "\n\n".join(part() for name, part in parts.items() if (ROOT / "bench/results" / name).exists())


RUNS = {"trial": "`trial`, preset `paper`", "best": "`trial`, `best`: four of `paper` averaged", "tiny": "`trial`, preset `tiny`",
        "window": "`window`, preset `paper`"}
METHODS = {"network": "", "ridge": "ridge regression", "bicubic": "bicubic", "mean_image": "mean image"}


def accuracy():
    found = {(r["split"], r["method"], r["part"]): r for r in rows("real_recordings.csv")}

    def cell(row, figure, digits):
        mean, half = float(row[figure]), float(row[figure + "_ci95"])
        return f"{mean:.{digits}f}" + (f" ± {half:.{digits}f}" if half > 0 else "")

    lines = ["| split and method | contact SSIM | contact PSNR dB | all SSIM | all PSNR dB | position error mm |", "|---|---|---|---|---|---|"]
    for run, name in RUNS.items():
        for method, label in METHODS.items():
            if method != "network" and run != "trial" or (run, method, "contact") not in found:
                continue
            contact, every = found[run, method, "contact"], found[run, method, "all"]
            lines.append(f"| {name if method == 'network' else label} | {cell(contact, 'ssim', 3)} | {cell(contact, 'psnr_mean_db', 1)} | "
                         f"{cell(every, 'ssim', 3)} | {cell(every, 'psnr_mean_db', 1)} | {cell(contact, 'position_error_mm', 2)} |")
    return "\n".join(lines)


def main():
    readme = ROOT / "README.md"
    text = readme.read_text()
    for name, section in {"speed": speed, "accuracy": accuracy}.items():
        new = f"<!-- {name} -->\n{section()}\n<!-- /{name} -->"
        text, count = re.subn(f"<!-- {name} -->.*<!-- /{name} -->", lambda _: new, text, flags=re.DOTALL)
        if count != 1:
            raise SystemExit(f"readme_figures.py: README.md has no lines <!-- {name} --> ... <!-- /{name} -->")
    readme.write_text(text)


if __name__ == "__main__":
    main()
