#!/usr/bin/env python3
"""How the rig's finger lies on the plate: the simulator's law of contact fitted to real passes.

    finger_fit.py RECORDINGS ... > finger_fit.csv

RECORDINGS are folders that supertac-import or supertac-simulate wrote. Of every pass over the rig's bumps and ridges the
indentation, the tilt across and along the slide, the rise of the path above the plate and the offset of the position
are fitted by least squares to the signals every millimetre, with a free gain for every taxel. Stiffness, pad and dome
stay those of data/recordings/finger_model.h. Signals at the limit to which the recordings were cut do not count.
Beside it the width of the signals' peaks at half their height, which no law has part in: the median over taxels that
feel enough and are never cut, without a pass's first and last element. Where elements lie 6 mm apart peaks run together.
Needs NumPy and SciPy; about two seconds a pass."""
import csv
import json
import pathlib
import struct
import sys

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks, peak_widths

PITCH, REST, FLOOR = 3.0, 2.442, 2.0925  # mm, volts
STIFFNESS, SIGMA, RADIUS = 15.0, 2.27, 47.0
WIDTH, LENGTH, BESIDE = 36.0, 108.0, -3.0  # of the plate; the height of what is beside it (mm)
ACROSS, ALONG = 2 * np.arange(-4, 5.0), 0.5 * np.arange(-22, 23.0)  # points of the pad (mm)
PLATES = {"3_Bumps": (12, True), "6_Bumps": (6, True), "4_Ridges": (9, False), "6_Ridges": (6, False)}
LOW, HIGH = [-2, -0.25, -0.25, -1.5, -2], [4, 0.25, 0.25, 1.5, 2]


def height(plate, y):
    """Of the plate's surface at y (mm): data/plates/plate.h."""
    pitch, half_round = PLATES[plate]
    width = 5.0 if half_round else 2.5
    count = int((WIDTH - width) // pitch) + 1
    first = LENGTH / 2 - (count - 1) * pitch / 2
    d = y - (first + np.clip(np.round((y - first) / pitch), 0, count - 1) * pitch)
    z = np.sqrt(np.maximum(0, 6.25 - d * d)) if half_round else 2.5 * np.maximum(0, 1 - 2 * abs(d) / width)
    return np.where((y < 0) | (y > LENGTH), BESIDE, z)


def bells(points):
    weights = np.exp(-0.5 * ((points - (np.arange(4)[:, None] - 1.5) * PITCH) / SIGMA) ** 2)
    return weights / weights.sum(1, keepdims=True)


def loads(plate, x, y, indentation, across, along, rise):
    """Load on every taxel [position][16]: finger_model.h."""
    surface = np.repeat(height(plate, y[:, None] + ALONG)[:, None, :], len(ACROSS), 1)
    surface[:, (x + ACROSS < 0) | (x + ACROSS > WIDTH), :] = BESIDE
    rises = (ACROSS[:, None] ** 2 + ALONG**2) / (2 * RADIUS) + across * ACROSS[:, None] + along * ALONG
    depth = surface - (rises - rises.min()) + (indentation - rise * (y - LENGTH / 2) / 50)[:, None, None]
    area, lift = 2 * 0.5, np.zeros(len(y))
    for _ in range(12):  # balance of the mount
        pressed = np.maximum(0, depth - lift[:, None, None])
        excess = area * pressed.sum((1, 2)) - STIFFNESS * lift
        lift += excess / (STIFFNESS + area * (pressed > 0).sum((1, 2)))
    rows = np.maximum(0, depth - lift[:, None, None]) @ bells(ALONG).T
    return np.einsum("nir,ci->nrc", rows, bells(ACROSS)).reshape(len(y), 16)


def read(path):
    data = path.read_bytes()
    size = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8 : 8 + size])
    about = header.pop("__metadata__")
    kinds = {"F32": "<f4", "F64": "<f8"}
    return about | {
        name: np.frombuffer(data[8 + size + t["data_offsets"][0] : 8 + size + t["data_offsets"][1]], kinds[t["dtype"]])
        .reshape(t["shape"]).astype(float)
        for name, t in header.items()
    }


def slide(pass_):
    """Positions and voltages where the finger slides, by y."""
    known = np.isfinite(pass_["position_mm"]).all(1)
    if "lift_mm" in pass_:
        known &= pass_["lift_mm"] <= 0
    position, volts = pass_["position_mm"][known], pass_["volts"][known]
    order = np.argsort(position[:, 1])
    return position[order], volts[order]


def signals(position, volts):
    """x, y every mm, signals below rest [y][16] and which of them were cut."""
    y = np.arange(max(2, position[:, 1].min() + 0.5), min(106, position[:, 1].max() - 0.5))
    along = [np.interp(y, position[:, 1], v) for v in volts.T]
    cut = [np.interp(y, position[:, 1], v) > 0.01 for v in (volts.T <= FLOOR).astype(float)]
    felt = REST - np.stack(along, 1)
    return np.median(position[:, 0]), y, felt - np.minimum(np.quantile(felt, 0.02, axis=0), 0.02), np.stack(cut, 1)


def peak_width(plate, position, volts):
    """mm, or nothing where too few peaks stand alone."""
    pitch, step, widths = PLATES[plate][0], 0.1, []
    y = np.arange(30, 78, step)
    for taxel in volts.T:
        felt = REST - np.interp(y, position[:, 1], taxel)
        if felt.max() < 0.02 or felt.max() > 0.95 * (REST - FLOOR):
            continue
        at = find_peaks(felt, prominence=felt.max() / 2)[0]
        inner = abs(y[at] - LENGTH / 2) < (WIDTH - pitch) / 2
        widths += list(step * peak_widths(felt, at, rel_height=0.5)[0][inner])
    return np.median(widths) if pitch > 6 and len(widths) >= 4 else None


def fit(plate, position, volts):
    x, y, felt, cut = signals(position, volts)

    def residuals(p):
        load = loads(plate, x, y + p[4], *p[:4])
        gain = (load * felt * ~cut).sum(0) / np.maximum((load**2 * ~cut).sum(0), 1e-9)
        off = load * np.clip(gain, 0, 20) - felt
        return np.where(cut & (off > 0), 0, off).ravel()

    starts = [[a, 0, b, 0, 0] for a in (0.3, 1.2) for b in (-0.03, 0.05)]
    best = min((least_squares(residuals, s, bounds=(LOW, HIGH), diff_step=1e-3, max_nfev=25) for s in starts),
               key=lambda r: r.cost)
    return 1 - 2 * best.cost / ((felt - felt.mean(0)) ** 2).sum(), best.x


def main():
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow("source,trial,plate,pass,explained,indentation_mm,tilt_across,tilt_along,rise_mm_per_50_mm,offset_mm,peak_mm".split(","))
    for folder in map(pathlib.Path, sys.argv[1:]):
        passes = map(read, sorted(folder.glob("*.safetensors")))
        for pass_ in sorted((p for p in passes if p["plate"] in PLATES), key=lambda p: p["trial"]):
            plate, felt = pass_["plate"], slide(pass_)
            explained, p = fit(plate, *felt)
            peak = peak_width(plate, *felt)
            out.writerow([pass_["source"], pass_["trial"], plate, pass_["pass"], f"{explained:.3f}",
                          *(f"{v:.3f}" for v in p), "" if peak is None else f"{peak:.2f}"])
            sys.stdout.flush()


if __name__ == "__main__":
    main()
