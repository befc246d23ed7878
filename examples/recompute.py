#!/usr/bin/env python3
"""Does again, with NumPy alone, every step that supertac-explain wrote down, from volts to pixels.

    supertac-explain model.safetensors --recording pass.safetensors --at 6.2 --out explained.safetensors
    examples/recompute.py explained.safetensors model.safetensors

Each step is computed in double precision from the arrays that it is said to have been made of, with the weights of the
model's own file, and compared with what was written. The program adds in single precision, where every addition is
rounded by up to 6e-8 of the sum so far. So a difference is judged as a share of the largest sum of magnitudes, that of
the same step without signs, which may be well above the largest value where terms cancel; the share of the largest
value stands beside it. Exit code 1 when the former is above 1e-6.
"""
import json
import struct
import sys

import numpy as np

TOLERANCE = 1e-6


def read(path):
    """Tensors and metadata of a safetensors file."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack("<Q", data[:8])[0]
    header = json.loads(data[8:8 + length])
    metadata = header.pop("__metadata__", {})
    types = {"F32": "<f4", "F64": "<f8"}
    tensors = {}
    for name, entry in header.items():
        begin, end = (8 + length + at for at in entry["data_offsets"])
        if entry["dtype"] in types:
            tensors[name] = np.frombuffer(data[begin:end], types[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata


def scaled(volts, time_s, signal, samples):
    """Means over the cells of an even grid, scaled to [0,1]; an empty cell repeats the one before."""
    cell = np.maximum(0, np.ceil((time_s - time_s[0]) * signal["rate_hz"] - 0.5 - 1e-6)).astype(int)
    grid = []
    for j in range(cell[-1] + 1):
        here = volts[cell == j].astype(float)
        grid.append(here.mean(axis=0).astype(np.float32) if len(here) else grid[-1])
    v = np.array(grid[-samples:], dtype=float)
    return np.clip((signal["rest_volts"] - v) / signal["span_volts"], 0, 1)


def levelled(window, signal):
    """Each window to its own rest and gain; percentiles are the lower edges of 256 bins."""
    bins = np.minimum(np.maximum(window, 0) * 256, 255).astype(int)
    ordered = np.sort(bins, axis=0)
    rest = ordered[len(window) // 20] / 256
    top = ordered[-min(3, len(window))] / 256
    gain = max(signal["least_gain"], (top - signal["rest_removed"] * rest).max())
    return np.clip((window - signal["rest_removed"] * rest) / gain, 0, 1)


def activated(y, step):
    return np.where(y > 0, y, step["slope"] * y)


def convolution(x, w, b, step, transposed):
    """x [N,pixels...,in]; w as PyTorch has it, [out,in,k...], or [in,out,k...] of a transposed one."""
    flat = x.ndim == 3
    if flat:  # one row
        x, w = x[:, None], w[:, :, None]
    high, wide = w.shape[2:]
    s, p = step["stride"], step["padding"]
    s_h, p_h = (1, 0) if flat else (s, p)
    n, rows, columns, _ = x.shape
    if transposed:
        full = np.zeros((n, (rows - 1) * s_h + high, (columns - 1) * s + wide, w.shape[1]))
        for i in range(high):
            for j in range(wide):
                full[:, i:i + (rows - 1) * s_h + 1:s_h, j:j + (columns - 1) * s + 1:s] += x @ w[:, :, i, j]
        y = full[:, p_h:full.shape[1] - p_h, p:full.shape[2] - p]
    else:
        x = np.pad(x, ((0, 0), (p_h, p_h), (p, p), (0, 0)))
        out_h, out_w = (x.shape[1] - high) // s_h + 1, (x.shape[2] - wide) // s + 1
        y = sum(x[:, i:i + (out_h - 1) * s_h + 1:s_h, j:j + (out_w - 1) * s + 1:s] @ w[:, :, i, j].T
                for i in range(high) for j in range(wide))
    return activated((y[:, 0] if flat else y) + b, step)


def computed(step, x, shape):
    op = step["op"]
    if op == "take_runs":
        runs = [x[0][..., at:at + step["run"]] for at in range(step["first"], x[0].shape[-1], step["step"])]
        return np.concatenate(runs, axis=-1)[..., :shape[-1]]
    if op.startswith("conv"):
        return convolution(*x, step, "transpose" in op)
    if op == "linear":
        w = x[1].reshape(x[1].shape[0], -1)  # a 1x1 convolution in the file
        return activated(x[0] @ w.T + x[2], step)
    return {
        "concat": lambda: np.concatenate(x, axis=-1),
        "flatten_channels_first": lambda: np.moveaxis(x[0], -1, 1).reshape(len(x[0]), -1),
        "unflatten_channels_first":
            lambda: np.moveaxis(x[0].reshape(len(x[0]), shape[-1], *shape[1:-1]), 1, -1),
        "global_mean": lambda: x[0].mean(axis=(1, 2)),
        "gated_sum": lambda: x[0] + x[1] * x[2][:, None, None],
        "sigmoid": lambda: 1 / (1 + np.exp(-x[0])),
        "add": lambda: x[0] + x[1],
    }[op]()


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    arrays, metadata = read(sys.argv[1])
    weights, _ = read(sys.argv[2])
    steps, signal = json.loads(metadata["steps"]), json.loads(metadata["signal"])
    known = {name: x.astype(float) for name, x in {**weights, **arrays}.items()}
    wrong = 0

    def compare(name, found, expected, magnitudes=None):
        nonlocal wrong
        difference = np.abs(found.reshape(expected.shape) - expected).max()
        largest = max(np.abs(expected).max(), 1e-30)
        error = difference / max(largest, 0 if magnitudes is None else magnitudes.max())
        wrong += not error <= TOLERANCE
        print(f"{name:34} {str(list(expected.shape)):18} {error:.1e}  {difference / largest:.1e}"
              f"{'' if error <= TOLERANCE else '  WRONG'}")

    print(f"{'array':34} {'shape':18} of sums  of values")
    compare("scaled", scaled(arrays["volts"], arrays["time_s"], signal, len(arrays["scaled"])), known["scaled"])
    if signal["levelled"]:
        compare("input", levelled(known["scaled"], signal), known["input"])
    for step in steps:
        x = [known[name] for name in step["inputs"]]
        if step["op"] == "reshape":  # the same numbers
            known[step["y"]] = x[0].reshape(step["shape"])
            continue
        expected = known[step["y"]]
        without_signs = computed(step | {"slope": 1}, [np.abs(part) for part in x], expected.shape)
        compare(step["y"], computed(step, x, expected.shape), expected, without_signs)
    drawn = [known[step["y"]] for step in steps if known[step["y"]].shape == known["picture"].shape]
    error = np.abs(drawn[0] - known["picture"]).max() / np.abs(known["picture"]).max()
    print(f"the picture as programs draw it differs from the last of these by {error:.1e} of its largest value")
    print(f"{len(steps)} steps, {wrong} wrong")
    sys.exit(1 if wrong or error > 1e-5 else 0)


if __name__ == "__main__":
    main()
