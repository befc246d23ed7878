#!/usr/bin/env python3
"""Accuracy against time on the unseen trial: every model in fp32 and int8, and what needs no training; on one thread.

    bench/studies/precision.py BIN RECORDINGS RESULTS.csv NAME=MODEL[,MODEL...] ...

The pictures of several models are averaged. Times are medians over five rounds by turns; nothing else should run."""
import csv
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import source  # noqa: E402

PLATES = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"
UNTRAINED = {"mean_image": "mean image", "bicubic": "bicubic", "ridge": "ridge regression"}
PRECISIONS, ROUNDS = ("fp32", "int8"), 5


def main():
    binaries, recordings, results, *models = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder, open(results, "w", newline="") as file:
        out = pathlib.Path(folder) / "scores.json"
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["name", "precision", "contact_ssim", "contact_psnr_db", "median_us", *source()])

        def score(model, precision, limit):
            words = ["--data", recordings, "--plates", PLATES, "--model", model, "--precision", precision, "--limit", str(limit),
                     "--threads", "1", "--json", out, "--force", "--quiet"]
            subprocess.run([pathlib.Path(binaries) / "supertac-evaluate", *words], check=True, stdout=subprocess.DEVNULL)
            return json.loads(out.read_text())

        def write(name, precision, contact, times):
            table.writerow([name, precision, f"{contact['ssim']:.4f}", f"{contact['psnr_mean_db']:.2f}",
                            f"{statistics.median(times):.4g}", *source().values()])
            file.flush()  # a model that fails must not take the others' figures with it

        for number, named in enumerate(models):
            name, model = named.split("=", 1)
            rounds = [(precision, score(model, precision, 200)["latency"]) for _ in range(ROUNDS) for precision in PRECISIONS]
            whole = {precision: score(model, precision, 0) for precision in PRECISIONS}
            times = lambda of, method: [latency[method]["median_us"] for precision, latency in rounds if precision == of]
            for key, title in UNTRAINED.items() if number == 0 else ():
                write(title, "fp32", whole["fp32"]["baselines"][key]["contact"], times("fp32", key))
            for precision in PRECISIONS:
                write(name, precision, whole[precision]["contact"], times(precision, "network"))


if __name__ == "__main__":
    main()
