#!/usr/bin/env python3
"""Does again, with NumPy alone, every step that supertac-check picture wrote down, from volts to pixels.

    supertac-check picture model.safetensors --recording pass.safetensors --at 6.2 --out explained.safetensors
    examples/recompute.py explained.safetensors model.safetensors

Each step is computed from the arrays that it is said to have been made of, with the weights of the model's own file, and
compared with what was written; examples/referee.py has the arithmetic. Printed is the largest difference, as a share of
the array's largest value, and how many numbers have the same bits: all of them in every op. Exit code 1 when an op has
other bits, or the window differs by more than 1e-6.
"""
import json
import pathlib
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import numpy as np  # noqa: E402

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from supertac.files import read  # noqa: E402
from supertac.model import level  # noqa: E402

import referee  # noqa: E402

TOLERANCE = 1e-6


def scaled(volts, time_s, signal, samples):
    """Means over the cells of an even grid, scaled to [0,1]; an empty cell repeats the one before. A window of one
    sample is the newest frame."""
    if samples == 1:
        return np.clip((signal["rest_volts"] - volts[-1:].astype(float)) / signal["span_volts"], 0, 1)
    cell = np.maximum(0, np.ceil((time_s - time_s[0]) * signal["rate_hz"] - 0.5 - 1e-6)).astype(int)
    grid = []
    for j in range(cell[-1] + 1):
        here = volts[cell == j].astype(float)
        grid.append(here.mean(axis=0).astype(np.float32) if len(here) else grid[-1])
    v = np.array(grid[-samples:], dtype=float)
    return np.clip((signal["rest_volts"] - v) / signal["span_volts"], 0, 1)


def in_memory(step, w):
    """Weights of a file have PyTorch's order of axes; here the kernel's come first, then inputs, then outputs."""
    if step["op"] == "linear":  # or a 1x1 convolution in the file
        return w.reshape(w.shape[:2]).T
    return np.moveaxis(w, (0, 1), (-2, -1) if "transpose" in step["op"] else (-1, -2))


def computed(step, x):
    if step["op"] == "linear" or step["op"].startswith("conv"):
        x[1] = in_memory(step, x[1])
    return referee.computed({"op": step["op"], "settings": step, "inputs": range(len(x))}, x)[0]


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    arrays, metadata = read(sys.argv[1])
    weights, _ = read(sys.argv[2])
    steps, signal = json.loads(metadata["steps"]), json.loads(metadata["signal"])
    known = {**weights, **arrays}
    wrong = 0

    def compare(name, found, expected, tolerance=0):
        nonlocal wrong
        found = found.reshape(expected.shape).astype(np.float32)
        error = np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-30)
        wrong += not error <= tolerance
        print(f"{name:34} {str(list(expected.shape)):18} {error:.1e}  {int(100 * np.mean(found == expected))} %"
              f"{'' if error <= tolerance else '  WRONG'}")

    print(f"{'array':34} {'shape':18} error    same bits")
    compare("scaled", scaled(arrays["volts"], arrays["time_s"], signal, len(arrays["scaled"])), known["scaled"],
            TOLERANCE)
    if signal["levelled"]:
        compare("input", level(known["scaled"][None])[0], known["input"], TOLERANCE)
    for step in steps:
        x = [known[name] for name in step["inputs"]]
        compare(step["y"], computed(step, x), known[step["y"]])
    drawn = [known[step["y"]] for step in steps if known[step["y"]].shape == known["picture"].shape]
    error = np.abs(drawn[0] - known["picture"]).max() / np.abs(known["picture"]).max()
    print(f"the picture as programs draw it differs from the last of these by {error:.1e} of its largest value")
    print(f"{len(steps)} steps, {wrong} wrong")
    sys.exit(1 if wrong or error > 1e-5 else 0)


if __name__ == "__main__":
    main()
