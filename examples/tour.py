#!/usr/bin/env python3
"""The Python package from recordings to pictures, in cells as Jupyter and editors know them (pip install ./python):

    supertac-simulate --out simulated --plates 6_Ridges --passes 1 --speeds 10 && examples/tour.py simulated
"""
# %% A recording: frames with times, positions and metadata.
import pathlib
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import numpy as np  # noqa: E402
import supertac  # noqa: E402

data = pathlib.Path(sys.argv[1])
recording = supertac.read_recording(sorted(data.glob("*.safetensors"))[0])
print(f"{len(recording.time_s)} frames of {recording.array} at {1 / recording.period_s:.0f} Hz")

# %% One of your own needs no more than times and signals; here every second frame of the other.
half = supertac.Recording(recording.time_s[::2], recording.volts[::2], recording.position_mm[::2],
                          metadata={"plate": recording.metadata["plate"]})
folder = data / "half"
folder.mkdir(exist_ok=True)
supertac.write_recording(folder / "half.safetensors", half)

# %% Training, as supertac-train does it; a callback that returns True ends it early.
losses = []
supertac.train("tiny", folder, folder / "model", lambda step, loss: losses.append(loss), epochs=2, stride=2, split="none")
print(f"{len(losses)} steps, loss {losses[0]:.3f} to {losses[-1]:.3f}")

# %% Pictures of all windows, by NumPy and by the C library.
model = supertac.load_model(folder / "model")
times, volts = model.windows(half)
by_numpy, by_library = model.draw(volts[:50]), model.draw(volts[:50], precision="fp32")
print(f"pictures {by_numpy.picture.shape}, within {np.abs(by_numpy.picture - by_library.picture).max():.1e} of each other")

# %% The same live, frame by frame.
live = supertac.LiveWindow(model, frame_hz=1 / half.period_s)
drawn = [picture for frame in zip(half.time_s, half.volts) if (picture := live.push(*frame)) is not None]
print(f"{len(drawn)} pictures live, the first within {np.abs(drawn[0] - by_library.picture[0]).max():.1e} of that above")
