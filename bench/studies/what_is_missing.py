#!/usr/bin/env python3
"""What of a plate is drawn wrong: its widths, its place, or its heights? Each picture in contact is scored as drawn, and after the
one change that suits its truth best, which no network could know:
    width   x^p, p from .4 to 4: above 1 slopes draw in and elements become narrower, below 1 wider
    place   moved along the slide by up to 1.5 mm
    height  times .5 to 2, cut at 1
    what_is_missing.py BIN RECORDINGS RESULTS.csv NETWORK SEED MODEL=PLATE ...
RESULTS.csv grows by a line for each model and plate, which NETWORK and SEED describe. Needs NumPy and PyTorch
(bench/peers/requirements.txt). Half a minute a model."""
import csv
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "peers"))
from pytorch_model import read_safetensors  # noqa: E402

POWERS, STEPS, FACTORS = (0.4, 0.5, 0.65, 0.8, 1, 1.25, 1.6, 2, 2.5, 3, 4), np.arange(-2, 2.25, 0.25), (0.5, 0.65, 0.8, 1, 1.25, 1.6, 2)
WINDOWS, PIXEL_MM = 1000, 0.75


def ssim(a, b):
    """Wang 2004 of pictures [N][H][W] with a range of 1: Gaussian window of 11x11 with a deviation of 1.5, valid places only."""
    weights = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    weights /= weights.sum()
    blurred = lambda x: sliding_window_view(sliding_window_view(x, 11, axis=1) @ weights, 11, axis=2) @ weights
    ma, mb = blurred(a), blurred(b)
    va, vb, cov = blurred(a * a) - ma**2, blurred(b * b) - mb**2, blurred(a * b) - ma * mb
    return ((2 * ma * mb + 1e-4) * (2 * cov + 9e-4) / ((ma**2 + mb**2 + 1e-4) * (va + vb + 9e-4))).mean((1, 2))


def moved(pictures, pixels):
    """Along the slide, the edge row repeated, between rows on a straight line."""
    places = np.clip(np.arange(pictures.shape[1]) + pixels, 0, pictures.shape[1] - 1)
    before = np.floor(places).astype(int)
    after, part = np.minimum(before + 1, pictures.shape[1] - 1), (places - before)[None, :, None]
    return pictures[:, before] * (1 - part) + pictures[:, after] * part


def best(truths, candidates):
    """Of each picture the candidate that suits its truth best, and all candidates' SSIM."""
    scores = np.stack([ssim(c, truths) for c in candidates])
    chosen = scores.argmax(0)
    return np.stack(candidates)[chosen, np.arange(len(truths))], scores


def scores_of(pictures, truths):
    pictures = np.clip(pictures.astype(float), 0, 1)
    truths = truths.astype(float)
    narrower, widths = best(truths, [pictures**p for p in POWERS])
    placed, places = best(truths, [moved(pictures, s) for s in STEPS])
    _, heights = best(truths, [np.minimum(1, pictures * f) for f in FACTORS])
    both, _ = best(truths, [moved(narrower, s) for s in STEPS])
    _, three = best(truths, [np.minimum(1, both * f) for f in FACTORS])
    one_power, one_step = widths.mean(1).argmax(), places.mean(1).argmax()
    return {"as_drawn": widths[POWERS.index(1)].mean(), "width": widths.max(0).mean(), "place": places.max(0).mean(),
            "height": heights.max(0).mean(), "all_three": three.max(0).mean(), "one_power": POWERS[one_power],
            "by_one_power": widths[one_power].mean(), "one_step_mm": PIXEL_MM * STEPS[one_step], "by_one_step": places[one_step].mean()}


def main():
    if len(sys.argv) < 7:
        sys.exit(__doc__)
    binaries, recordings, results, network, seed = pathlib.Path(sys.argv[1]), sys.argv[2], pathlib.Path(sys.argv[3]), *sys.argv[4:6]
    with tempfile.TemporaryDirectory() as folder, open(results, "a", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        for number, (model, plate) in enumerate(argument.rsplit("=", 1) for argument in sys.argv[6:]):
            outputs = pathlib.Path(folder) / "outputs.safetensors"
            subprocess.run([binaries / "supertac-evaluate", "--model", model, "--data", recordings, "--plates", plate, "--split", "none",
                            "--outputs", outputs, "--force", "--quiet"], check=True, stdout=subprocess.DEVNULL)
            tensors, _ = read_safetensors(outputs)
            contact = np.flatnonzero(tensors["truth"].max((1, 2)) > 0)
            looked_at = contact[np.linspace(0, len(contact) - 1, min(WINDOWS, len(contact))).astype(int)]
            scores = scores_of(tensors["output"][looked_at], tensors["truth"][looked_at])
            if number == 0 and results.stat().st_size == 0:
                out.writerow(["network", "seed", "plate", *scores])
            out.writerow([network, seed, plate, *(f"{score:.4f}" for score in scores.values())])
            file.flush()


if __name__ == "__main__":
    main()
