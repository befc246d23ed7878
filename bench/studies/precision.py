#!/usr/bin/env python3
"""Accuracy against time on the unseen trial: every model in fp32 and int8, and what needs no training; on one thread.
    precision.py BIN RECORDINGS RESULTS.csv NAME=MODEL[,MODEL...] ... [NAME=MODEL@PAIRS ...]
A model of several files is a committee; one that sees single frames is scored on PAIRS (supertac-evaluate --write-pairs), in fp32.
Times are medians over five rounds by turns; nothing else should run."""
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

PLATES = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"
UNTRAINED = {"mean_image": "mean image", "bicubic": "bicubic", "ridge": "ridge regression"}
ROUNDS = 5


class Scorer:
    def __init__(self, binaries, recordings, folder):
        self.binaries, self.recordings, self.out = pathlib.Path(binaries), recordings, pathlib.Path(folder) / "scores.json"

    def __call__(self, model, precision, limit):
        model, _, pairs = model.partition("@")
        data = ["--pairs", pairs, "--split", "none"] if pairs else ["--data", self.recordings, "--plates", PLATES]
        subprocess.run([self.binaries / "supertac-evaluate", *data, "--model", model, "--precision", precision, "--limit", str(limit),
                        "--threads", "1", "--json", self.out, "--force", "--quiet"], check=True, stdout=subprocess.DEVNULL)
        return json.loads(self.out.read_text())


def line(name, precision, contact, times):
    contact = contact.get("network", contact)  # of single frames
    return f"{name},{precision},{contact['ssim']:.4f},{contact['psnr_mean_db']:.2f},{statistics.median(times):.4g}"


def main():
    binaries, recordings, results, *models = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder, open(results, "w") as out:
        def write(text):
            print(text, file=out, flush=True)  # a model that fails must not take the others' figures with it

        score = Scorer(binaries, recordings, folder)
        write("name,precision,contact_ssim,contact_psnr_db,median_us")
        for number, named in enumerate(models):
            name, model = named.split("=", 1)
            precisions = ["fp32"] if "@" in model else ["fp32", "int8"]
            rounds = [(precision, score(model, precision, 200)["latency"]) for _ in range(ROUNDS) for precision in precisions]
            whole = {precision: score(model, precision, 0) for precision in precisions}
            if number == 0:
                for key, title in UNTRAINED.items():
                    write(line(title, "fp32", whole["fp32"]["baselines"][key]["contact"],
                               [latency[key]["median_us"] for precision, latency in rounds if precision == "fp32"]))
            for precision in precisions:
                write(line(name, precision, whole[precision]["contact"],
                           [latency["network"]["median_us"] for of, latency in rounds if of == precision]))


if __name__ == "__main__":
    main()
