#!/usr/bin/env python3
"""Plots a pass: what was felt, what the network draws, how sure it is; without a model what was felt. Needs NumPy and
matplotlib, nothing of C++; a notebook opens it cell by cell (`# %%`).

    examples/plot_pass.py model.safetensors simulated/6_Ridges_t1_p1_v10.safetensors pass.png
    examples/plot_pass.py touched.safetensors touched.png
"""
# %% The package in python/, installed or beside this folder.
import pathlib
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import matplotlib  # noqa: E402
import numpy as np  # noqa: E402

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import supertac  # noqa: E402

*model_path, recording_path, picture_path = sys.argv[1:]

# %% Windows in the sensor's unit, one for each frame that has a whole window behind it; without a model of one frame.
recording = supertac.read_recording(recording_path)
model = supertac.load_model(model_path[0]) if model_path else None
times, volts = model.windows(recording) if model else (recording.time_s, recording.volts[:, None])
chosen = np.linspace(0, len(times) - 1, 16).astype(int)

# %% What the network takes, and what it draws.
array, lines = recording.array, {}
inputs = model.scale(volts[chosen]) if model else volts[chosen]
lines["felt"] = inputs[:, -1].reshape(-1, array["rows"], array["columns"], array["channels"]).mean(3)
if model:
    drawn = model.draw(volts[chosen])
    lines |= {"drawn": drawn.picture, "predicted error": drawn.predicted_error}
    lines = {name: pictures for name, pictures in lines.items() if pictures is not None}
print(f"{len(times)} windows of {volts.shape[1]} samples; {', '.join(lines)}: {len(chosen)} of {lines['felt'][0].shape} taxels")

# %% Signals over time, and under them the pictures: input, output, predicted error.
unit = recording.signals["unit"]
figure = pyplot.figure(figsize=(14, 6), layout="constrained")
rows = figure.subfigures(2, 1, height_ratios=(1, 1.6))
axes = rows[0].subplots()
axes.plot(recording.time_s, recording.volts, linewidth=0.5)
axes.set(xlabel="time (s)", ylabel=unit, title=f"{recording.metadata.get('plate', '')}: {volts.shape[2]} signals")
axes.vlines(times[chosen], *axes.get_ylim(), colors="0.8", linewidth=0.5)
low, high = (0, 1) if model else (recording.volts.min(), recording.volts.max())
for line, (name, pictures) in zip(rows[1].subplots(len(lines), len(chosen), squeeze=False), lines.items()):
    for axes, picture in zip(line, pictures):
        axes.imshow(picture, origin="lower", cmap="gray", vmin=low, vmax=high)
        axes.set(xticks=[], yticks=[])
    line[0].set_ylabel(name)
figure.savefig(picture_path, dpi=100)
