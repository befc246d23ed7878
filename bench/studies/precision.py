#!/usr/bin/env python3
"""Accuracy against time on the unseen trial: every model in fp32 and int8, and what needs no training; on one thread.

    bench/studies/precision.py BIN RECORDINGS RESULTS.csv NAME=MODEL[,MODEL...] ...

The pictures of several models are averaged. Times are medians over five rounds by turns; nothing else should run."""
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import write  # noqa: E402

PLATES = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"
UNTRAINED = {"mean_image": "mean image", "bicubic": "bicubic", "ridge": "ridge regression"}
PRECISIONS, ROUNDS = ("fp32", "int8"), 5


def main():
    binaries, recordings, results, *models = sys.argv[1:]
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "scores.json"

        def score(model, precision, limit):
            words = ["--data", recordings, "--plates", PLATES, "--model", model, "--precision", precision, "--limit", str(limit),
                     "--threads", "1", "--json", out, "--force", "--quiet"]
            subprocess.run([pathlib.Path(binaries) / "supertac-evaluate", *words], check=True, stdout=subprocess.DEVNULL)
            return json.loads(out.read_text())

        def add(name, precision, contact, times):
            lines.append({"name": name, "precision": precision, "contact_ssim": f"{contact['ssim']:.4f}",
                          "contact_psnr_db": f"{contact['psnr_mean_db']:.2f}", "median_us": statistics.median(times)})

        for number, named in enumerate(models):
            name, model = named.split("=", 1)
            rounds = [(precision, score(model, precision, 200)["latency"]) for _ in range(ROUNDS) for precision in PRECISIONS]
            whole = {precision: score(model, precision, 0) for precision in PRECISIONS}
            times = lambda of, method: [latency[method]["median_us"] for precision, latency in rounds if precision == of]
            for key, title in UNTRAINED.items() if number == 0 else ():
                add(title, "fp32", whole["fp32"]["baselines"][key]["contact"], times("fp32", key))
            for precision in PRECISIONS:
                add(name, precision, whole[precision]["contact"], times(precision, "network"))
            write(results, lines)  # a model that fails must not take the others' figures with it


if __name__ == "__main__":
    main()
