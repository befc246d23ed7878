#!/usr/bin/env python3
"""What int8 costs in accuracy and what it saves: every model on the unseen trial in both precisions, its time on one thread.
    precision.py BIN RECORDINGS RESULTS.csv NAME=MODEL[,MODEL...] ...
A model of several files is a committee. Times are medians over five rounds by turns; nothing else should run."""
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile

PLATES = "3_Bumps,6_Bumps,4_Ridges,6_Ridges"


def scores(binaries, recordings, model, precision, limit, folder):
    out = pathlib.Path(folder) / "scores.json"
    subprocess.run([binaries / "supertac-evaluate", "--data", recordings, "--plates", PLATES, "--model", model, "--precision",
                    precision, "--limit", str(limit), "--threads", "1", "--json", out, "--force", "--quiet"],
                   check=True, stdout=subprocess.DEVNULL)
    return json.loads(out.read_text())


def main():
    binaries, recordings, results, *models = sys.argv[1:]
    binaries = pathlib.Path(binaries)
    lines = ["name,precision,contact_ssim,contact_psnr_db,median_us"]
    with tempfile.TemporaryDirectory() as folder:
        for named in models:
            name, model = named.split("=", 1)
            times = {"fp32": [], "int8": []}
            for _ in range(5):
                for precision in times:
                    latency = scores(binaries, recordings, model, precision, 200, folder)["latency"]["network"]
                    times[precision].append(latency["median_us"])
            for precision, measured in times.items():
                contact = scores(binaries, recordings, model, precision, 0, folder)["contact"]
                lines.append(f"{name},{precision},{contact['ssim']:.4f},{contact['psnr_mean_db']:.2f},"
                             f"{statistics.median(measured):.1f}")
                print(lines[-1], flush=True)
    pathlib.Path(results).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
