#!/usr/bin/env python3
"""Plots a pass: what was felt, what the network draws, how sure it is. Needs NumPy and matplotlib, nothing of C++; a
notebook opens it cell by cell (`# %%`).

    examples/plot_pass.py model.safetensors simulated/6_Ridges_t1_p1_v10.safetensors pass.png
"""
# %% The package in python/, installed or beside this folder.
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "python"))
import supertac  # noqa: E402

model_path, recording_path, picture_path = sys.argv[1:4]

# %% Windows in volts, one for each frame that has a whole window behind it.
model = supertac.load_model(model_path)
recording = supertac.read_recording(recording_path)
times, volts = model.windows(recording)
chosen = np.linspace(0, len(times) - 1, 16).astype(int)

# %% What the network takes, and what it draws.
inputs = model.scale(volts[chosen])
drawn = model.draw(volts[chosen])
print(f"{len(times)} windows of {model.settings['timesteps']} samples; drawn: {len(chosen)} of {drawn.picture[0].shape}")

# %% Voltages over time, and under them the pictures: input, output, predicted error.
figure = pyplot.figure(figsize=(14, 6), layout="constrained")
rows = figure.subfigures(2, 1, height_ratios=(1, 1.6))
axes = rows[0].subplots()
axes.plot(recording.time_s, recording.volts, linewidth=0.5)
axes.set(xlabel="time (s)", ylabel="volts", title=f"{recording.metadata['plate']}: {volts.shape[2]} signals")
axes.vlines(times[chosen], *axes.get_ylim(), colors="0.8", linewidth=0.5)
array = recording.array
lines = {"felt": inputs[:, -1].reshape(-1, array["rows"], array["columns"], array["channels"]).mean(3),
         "drawn": drawn.picture, "predicted error": drawn.predicted_error}
lines = {name: pictures for name, pictures in lines.items() if pictures is not None}
for line, (name, pictures) in zip(rows[1].subplots(len(lines), len(chosen), squeeze=False), lines.items()):
    for axes, picture in zip(line, pictures):
        axes.imshow(picture, origin="lower", cmap="gray", vmin=0, vmax=1)
        axes.set(xticks=[], yticks=[])
    line[0].set_ylabel(name)
figure.savefig(picture_path, dpi=100)
