#!/usr/bin/env python3
"""Where the package is installed and nothing else of ours is: it has its library, which trains and draws.

    tests/python/wheel_test.py
"""
import json
import pathlib
import platform
import tempfile

import numpy as np

import supertac


def main():
    times = np.arange(1200) / 100
    place = np.stack(np.meshgrid(np.arange(4), np.arange(4), indexing="ij"), -1).reshape(-1, 2)
    at = np.stack([1.5 + 1.5 * np.sin(times), 1.5 + 1.5 * np.cos(0.7 * times)], 1)
    pressed = np.exp(-((place[None] - at[:, None]) ** 2).sum(2)).astype("f4")
    truth = pressed.reshape(-1, 4, 4).repeat(4, 1).repeat(4, 2)
    signals = {"unit": "counts", "pressed": "higher", "range": [40, 900]}
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        (folder / "data").mkdir()
        supertac.write_recording(folder / "data/a.safetensors", supertac.Recording(
            times, 40 + 860 * pressed, truth=truth, array={"rows": 4, "columns": 4, "pitch_mm": 5, "channels": 1},
            metadata={"signals": json.dumps(signals)}))
        supertac.train("frame", folder / "data", folder / "m.safetensors", epochs=1, stride=8, split="none")
        model = supertac.load(folder / "m.safetensors")
        windows = model.windows(supertac.load(folder / "data/a.safetensors"))[1][:50]
        by_library, by_numpy = model.draw(windows, precision="fp32").picture, model(windows)
        assert np.abs(by_library - by_numpy).max() < 1e-5
        print(f"Python {platform.python_version()}, {platform.libc_ver()}: {supertac.__version__} draws "
              f"{len(by_library)} pictures from {model}")


if __name__ == "__main__":
    main()
