#!/usr/bin/env python3
"""What large batches cost in accuracy: large_batches.py BIN RECORDINGS RESULTS.csv [OPTIONS of supertac-train].

Preset tiny, split trial, five seeds; every batch sees the same windows equally often, so that a batch of 1,024 makes a
sixteenth of the steps of 64. The learning rate is the preset's, or grows with the root of the batch. Two trainings at a
time, one thread each; contact SSIM and PSNR on the unseen trial.
"""
import concurrent.futures
import csv
import json
import math
import subprocess
import sys
import tempfile

BATCHES, SEEDS, USUAL_BATCH, USUAL_RATE = [64, 256, 1024], range(5), 64, 0.002


def score(binaries, recordings, options, folder, batch, rule, seed):
    out = f"{folder}/{batch}-{rule}-{seed}.safetensors"
    rate = USUAL_RATE * (math.sqrt(batch / USUAL_BATCH) if rule == "root" else 1)
    subprocess.run([f"{binaries}/supertac-train", "--data", recordings, "--out", out, "--preset", "tiny", "--batch",
                    str(batch), "--learning-rate", f"{rate:.6f}", "--seed", str(seed), "--threads", "1", "--quiet",
                    *options], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([f"{binaries}/supertac-evaluate", "--model", out, "--data", recordings, "--json", out + ".json",
                    "--threads", "1", "--quiet"], check=True, stdout=subprocess.DEVNULL)
    with open(out + ".json") as file:
        contact = json.load(file)["contact"]
    return [batch, rule, f"{rate:.6f}", seed, f"{contact['ssim']:.4f}", f"{contact['psnr_mean_db']:.4f}"]


def main():
    binaries, recordings, results, *options = sys.argv[1:]
    runs = [(batch, rule, seed) for batch in BATCHES for rule in ("usual", "root") for seed in SEEDS
            if batch != USUAL_BATCH or rule == "usual"]
    with tempfile.TemporaryDirectory() as folder, open(results, "w") as file, \
            concurrent.futures.ThreadPoolExecutor(2) as pool:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["batch", "rate_rule", "learning_rate", "seed", "contact_ssim", "contact_psnr_db"])
        for row in pool.map(lambda run: score(binaries, recordings, options, folder, *run), runs):
            writer.writerow(row)
            file.flush()
            print(*row, file=sys.stderr)


if __name__ == "__main__":
    main()
