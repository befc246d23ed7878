"""The table of baselines.sh as CSV: baselines.py DIR reads DIR/<method>_s<seed>.json. Means and 95 % intervals (Student's t)
over seeds; front is 1 where nothing cheaper is as accurate in contact."""
import json
import pathlib
import sys

from summarise import mean_and_interval

NAMES = {"trial": "paper", "best": "best: four of paper averaged", "tiny": "tiny", "plain-autoencoder": "paper, plain autoencoder",
         "frame": "one frame, our blocks", "srcnn": "one frame, SRCNN-style", "srgan": "one frame, GAN-style"}
SIMPLE = {"mean_image": "mean image", "nearest": "nearest", "bicubic": "bicubic", "ridge": "ridge from the window"}


def of_network(scores, part):
    return scores[part].get("network", scores[part])


results = {}  # method -> [(contact, all, latency)]
for path in sorted(pathlib.Path(sys.argv[1]).glob("*_s*.json")):
    method = path.stem.rsplit("_s", 1)[0]
    if method not in NAMES:
        continue
    scores = json.loads(path.read_text())
    results.setdefault(NAMES[method], []).append(
        (of_network(scores, "contact"), of_network(scores, "all"), scores["latency"]["network"]))
    if method == "trial":
        for name, title in SIMPLE.items():
            results.setdefault(title, []).append(
                (scores["baselines"][name]["contact"], scores["baselines"][name]["all"], scores["latency"][name]))

rows = []
for method, runs in results.items():
    ssim, ssim_half = mean_and_interval([c["ssim"] for c, _, _ in runs])
    psnr, psnr_half = mean_and_interval([c["psnr_mean_db"] for c, _, _ in runs])
    us = sorted(latency["median_us"] for _, _, latency in runs)[len(runs) // 2]
    whole = [mean_and_interval([a[f] for _, a, _ in runs])[0] for f in ("ssim", "psnr_mean_db")]
    rows.append([method, len(runs), ssim, ssim_half, psnr, psnr_half, *whole, us])
rows.sort(key=lambda row: row[-1])
print("method,seeds,contact_ssim,contact_ssim_ci95,contact_psnr_db,contact_psnr_db_ci95,all_ssim,all_psnr_db,median_us,front")
best = float("-inf")
for method, seeds, *figures in rows:
    front = figures[0] > best
    best = max(best, figures[0])
    print(f'"{method}",{seeds},' + ",".join(f"{f:.4f}" for f in figures) + f",{int(front)}")
