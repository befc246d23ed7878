#!/usr/bin/env python3
"""Does again, with NumPy alone, every step that supertac-explain wrote down, from volts to pixels.

    supertac-explain model.safetensors --recording pass.safetensors --at 6.2 --out explained.safetensors
    examples/recompute.py explained.safetensors model.safetensors

Each step is computed from the arrays that it is said to have been made of, with the weights of the model's own file, and
compared with what was written. Sums are made as the program makes them (docs/determinism.md): in single precision, from
the bias on, a fused multiply-add for each product, taps in the order of rows and columns, the channels of a tap one after
the other. A convolution of few outputs adds up the channels of each tap by itself first. Printed is the largest
difference, as a share of the array's largest value, and how many numbers have the same bits. Exit code 1 when a
difference is above 1e-6.
"""
import json
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))
from supertac.files import read  # noqa: E402
from supertac.model import level, sigmoid  # noqa: E402

TOLERANCE = 1e-6


def scaled(volts, time_s, signal, samples):
    """Means over the cells of an even grid, scaled to [0,1]; an empty cell repeats the one before."""
    cell = np.maximum(0, np.ceil((time_s - time_s[0]) * signal["rate_hz"] - 0.5 - 1e-6)).astype(int)
    grid = []
    for j in range(cell[-1] + 1):
        here = volts[cell == j].astype(float)
        grid.append(here.mean(axis=0).astype(np.float32) if len(here) else grid[-1])
    v = np.array(grid[-samples:], dtype=float)
    return np.clip((signal["rest_volts"] - v) / signal["span_volts"], 0, 1)


def fused(total, x, w):
    """total + x w: the product of two singles is exact in double precision, so the sum alone is rounded."""
    return (x.astype(float) * w + total).astype(np.float32)


def added(total, x, w):
    """total + x w over the last axis of x, one product after the other; w [in,out]."""
    for c in range(x.shape[-1]):
        total = fused(total, x[..., c:c + 1], w[c])
    return total


def activated(y, step):
    return np.where(y > 0, y, np.float32(step["slope"]) * y)


def convolution(x, w, b, step, transposed):
    """x [N,pixels...,in]; w as PyTorch has it, [out,in,k...], or [in,out,k...] of a transposed one."""
    flat = x.ndim == 3
    if flat:  # one row
        x, w = x[:, None], w[:, :, None]
    high, wide = w.shape[2:]
    s, p = step["stride"], step["padding"]
    s_h, p_h = (1, 0) if flat else (s, p)
    n, rows, columns, _ = x.shape
    narrow = high * wide * len(b) <= 16 and len(b) <= 8 and 2 * len(b) < x.shape[-1]
    if transposed:
        size = (rows - 1) * s_h + high, (columns - 1) * s + wide
    else:
        x = np.pad(x, ((0, 0), (p_h, p_h), (p, p), (0, 0)))
        size = (x.shape[1] - high) // s_h + 1, (x.shape[2] - wide) // s + 1
    y = np.broadcast_to(b, (n, *size, len(b))).copy()
    for i, j in np.ndindex(high, wide):
        if transposed:
            to, part = y[:, i:i + (rows - 1) * s_h + 1:s_h, j:j + (columns - 1) * s + 1:s], x
            kernel = w[:, :, i, j]
        else:
            to, part = y, x[:, i:i + (size[0] - 1) * s_h + 1:s_h, j:j + (size[1] - 1) * s + 1:s]
            kernel = w[:, :, i, j].T
        to[...] = to + added(np.zeros_like(to), part, kernel) if narrow else added(to, part, kernel)
    if transposed:
        y = y[:, p_h:y.shape[1] - p_h, p:y.shape[2] - p]
    return activated(y[:, 0] if flat else y, step)


def computed(step, x, shape):
    op = step["op"]
    if op == "take_runs":
        runs = [x[0][..., at:at + step["run"]] for at in range(step["first"], x[0].shape[-1], step["step"])]
        return np.concatenate(runs, axis=-1)[..., :shape[-1]]
    if op.startswith("conv"):
        return convolution(*x, step, "transpose" in op)
    if op == "linear":
        w = x[1].reshape(x[1].shape[0], -1)  # a 1x1 convolution in the file
        return activated(added(np.broadcast_to(x[2], (len(x[0]), len(x[2]))), x[0], w.T), step)
    return {
        "concat": lambda: np.concatenate(x, axis=-1),
        "last_frame": lambda: x[0][:, -1].reshape(-1, *shape[1:]),
        "flatten_channels_first": lambda: np.moveaxis(x[0], -1, 1).reshape(len(x[0]), -1),
        "unflatten_channels_first":
            lambda: np.moveaxis(x[0].reshape(len(x[0]), shape[-1], *shape[1:-1]), 1, -1),
        "global_mean": lambda: x[0].mean(axis=(1, 2), dtype=float),
        "gated_sum": lambda: x[0] + x[1] * x[2][:, None, None],
        "sigmoid": lambda: sigmoid(x[0]),
        "add": lambda: x[0] + x[1],
    }[op]()


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    arrays, metadata = read(sys.argv[1])
    weights, _ = read(sys.argv[2])
    steps, signal = json.loads(metadata["steps"]), json.loads(metadata["signal"])
    known = {**weights, **arrays}
    wrong = 0

    def compare(name, found, expected):
        nonlocal wrong
        found = found.reshape(expected.shape).astype(np.float32)
        error = np.abs(found - expected).max() / max(np.abs(expected).max(), 1e-30)
        wrong += not error <= TOLERANCE
        print(f"{name:34} {str(list(expected.shape)):18} {error:.1e}  {int(100 * np.mean(found == expected))} %"
              f"{'' if error <= TOLERANCE else '  WRONG'}")

    print(f"{'array':34} {'shape':18} error    same bits")
    compare("scaled", scaled(arrays["volts"], arrays["time_s"], signal, len(arrays["scaled"])), known["scaled"])
    if signal["levelled"]:
        compare("input", level(known["scaled"][None])[0], known["input"])
    for step in steps:
        x = [known[name] for name in step["inputs"]]
        if step["op"] == "reshape":  # the same numbers
            known[step["y"]] = x[0].reshape(step["shape"])
            continue
        compare(step["y"], computed(step, x, known[step["y"]].shape), known[step["y"]])
    drawn = [known[step["y"]] for step in steps if known[step["y"]].shape == known["picture"].shape]
    error = np.abs(drawn[0] - known["picture"]).max() / np.abs(known["picture"]).max()
    print(f"the picture as programs draw it differs from the last of these by {error:.1e} of its largest value")
    print(f"{len(steps)} steps, {wrong} wrong")
    sys.exit(1 if wrong or error > 1e-5 else 0)


if __name__ == "__main__":
    main()
