#!/usr/bin/env python3
"""Computes operators of a training step again, to the bit, with NumPy alone, and says which entry differs.

    supertac-check step model.safetensors --data DIR --step 40 --operator 3/ --out operators.safetensors
    examples/referee.py operators.safetensors

It follows docs/numerics.md and uses nothing of the program. Arrays are named by their SHA-256, which is checked first.
Operators are computed from what went into them; every bit that came out has to be the same, else the exit code is 1.
"""
import hashlib
import json
import struct
import sys

import numpy as np

F4, F8, ZERO = np.float32, np.float64, np.float32(0)


def read(path):
    with open(path, "rb") as file:
        header = json.loads(file.read(struct.unpack("<Q", file.read(8))[0]))
        data = file.read()
    operators, arrays = json.loads(header.pop("__metadata__")["operators"]), {}
    for name, info in header.items():
        part = data[info["data_offsets"][0]:info["data_offsets"][1]]
        if hashlib.sha256(part).hexdigest() != name[:64]:
            sys.exit(f"{path}: the array {name} is not what its name says")
        arrays[name] = np.frombuffer(part, "<f4").reshape(info["shape"])
    return operators, arrays


# ---- 1. Numbers (the sections of docs/numerics.md)
def fma(a, b, c):
    """a b + c, rounded once. In double precision the product is exact and the sum is rounded. Rounding it once more is
    wrong only just between two singles, or below the normal ones: there it is first rounded to odd by its own error
    (Boldo & Melquiond 2008)."""
    p, c = np.multiply(a, b, dtype=F8), np.asarray(c, F8)
    s = p + c
    doubt = ((s.view(np.int64) & 0x1FFFFFFF) == 0x10000000) | (np.abs(s) < 2.0**-125)
    if doubt.any():
        p, c, at = np.broadcast_to(p, s.shape)[doubt], np.broadcast_to(c, s.shape)[doubt], s[doubt]
        t = at - p
        error = (p - (at - t)) + (c - t)
        bits = at.view(np.int64)
        bits += np.where((error != 0) & ((bits & 1) == 0), np.where((error > 0) == (at > 0), 1, -1), 0)
        s[doubt] = at
    return s.astype(F4)


def in_order(terms, start):
    """start + terms[0] + terms[1] + ..., one after the other."""
    first = np.broadcast_to(np.asarray(start, terms.dtype), terms[:1].shape)
    return np.add.accumulate(np.concatenate([first, terms]), axis=0)[-1]


def sum16(terms):
    terms = np.asarray(terms, F8).ravel()
    return in_order(in_order(np.append(terms, np.zeros(-len(terms) % 16)).reshape(-1, 16), 0), 0)


def exp(x):
    x = np.minimum(np.maximum(x, F4(-87)), F4(88))
    shifted = x * F4(1.44269504) + F4(12582912)
    n = shifted - F4(12582912)
    r = (x - n * F4(0.693359375)) - n * F4(-2.12194440e-4)
    p = F4(1 / 5040)
    for term in (1 / 720, 1 / 120, 1 / 24, 1 / 6, 0.5, 1, 1):
        p = p * r + F4(term)
    power = np.asarray(shifted, F4).view(np.int32) - F4(12582912).view(np.int32)
    return p * ((power + 127) << 23).astype(np.int32).view(F4)


def sigmoid(x):
    e = exp(-np.abs(x))
    return np.where(x < 0, e, F4(1)) * (F4(1) / (F4(1) + e))


def activation(x, slope):
    floor = F4(np.finfo(F4).min if slope == 0 else -np.inf)
    return x if slope == 1 else np.where(x > 0, x, F4(slope) * np.maximum(floor, x))


# ---- 2. Gradients
def adds(before, term, first=ZERO):
    """With a first of -0 the term itself where nothing was before: to -0 everything adds as it is."""
    return (first if before is None else before) + term


def start_of(before, like):
    return np.zeros_like(like) if before is None else before.reshape(like.shape)


def outer(x, g, piece, before):
    """before + sum over rows of x^T g; the rows of a piece are summed by themselves."""
    for first in range(0, len(x), piece):
        sums = ZERO
        for n in range(first, min(first + piece, len(x))):
            sums = fma(x[n][..., None], g[n][..., None, :], sums)
        before = adds(before, sums)
    return before


# ---- 3. Convolutions and linear layers
class Conv:
    """x [N,H,W,in], w [kh,kw,in,out]; a sequence is a map of one row, and a linear layer's is one pixel."""

    def __init__(self, s, x, w):
        more, step, margin = [1] * (4 - x.ndim), s.get("stride", 1), s.get("padding", 0)
        self.x, self.w = x.reshape(len(x), *more, *x.shape[1:]), w.reshape(*more, *w.shape)
        self.y_shape = s["shape"][0], *more, *s["shape"][1:]
        self.slope, self.transposed = s["slope"], "transpose" in s["op"]
        self.kh, self.kw, self.cin, self.cout = self.w.shape
        self.stride, self.padding = ((1, step), (0, margin)) if more else ((step, step), (margin, margin))
        n, high, wide, _ = self.x.shape
        same = not self.transposed and step == self.kh % 2 == 1 and self.padding == (self.kh // 2, self.kw // 2)
        self.narrow = same and self.kw == 3 and self.kh * 3 * self.cout <= 16 and 2 * self.cout < self.cin
        self.winograd = (same and (self.kh, self.kw) == (3, 3) and n >= 4 and high * wide >= 64
                         and high % 4 == wide % 4 == self.cin % 16 == self.cout % 16 == 0)

    def padded(self, fine):
        return np.pad(fine, ((0, 0), *((p, p) for p in self.padding), (0, 0)))

    def met(self, fine, coarse, i, j):
        """The pixels of the padded fine map that tap (i, j) joins with those of the coarse one."""
        (sh, sw), (rows, columns) = self.stride, coarse.shape[1:3]
        return fine[:, i:i + (rows - 1) * sh + 1:sh, j:j + (columns - 1) * sw + 1:sw]

    def sums(self, source, w, total, to_fine, narrow=False):
        """total + sum over taps, then over the channels of source; w [kh,kw,channels of source, of total]."""
        source, total = (source, self.padded(total)) if to_fine else (self.padded(source), total.copy())
        for i, j in np.ndindex(self.kh, self.kw):
            x, y = (source, self.met(total, source, i, j)) if to_fine else (self.met(source, total, i, j), total)
            sums = np.zeros(y.shape, F4) if narrow else np.ascontiguousarray(y)
            for c in range(source.shape[3]):
                sums = fma(x[..., c:c + 1], w[i, j, c], sums)
            y[...] = y + sums if narrow else sums
        (ph, pw), (_, rows, columns, _) = self.padding if to_fine else (0, 0), total.shape
        return total[:, ph:rows - ph, pw:columns - pw] + (-ZERO if narrow else ZERO)

    def forward(self, bias):
        y = np.broadcast_to(bias, self.y_shape)
        if self.winograd:
            return activation(y + winograd(self.x, self.w), self.slope)
        return activation(self.sums(self.x, self.w, y, self.transposed, self.narrow), self.slope)

    def grad_x(self, gs, before):
        w, start = self.w.swapaxes(2, 3), start_of(before, self.x)
        if self.winograd:
            return start + winograd(gs, w[::-1, ::-1])
        return self.sums(gs.reshape(self.y_shape), w, start, not self.transposed)

    def grad_w(self, gs, before):
        gs, before = gs.reshape(self.y_shape), start_of(before, self.w)
        if self.winograd:
            return adds(before, winograd_grad_w(self.x, gs))
        if self.narrow:
            met = self.patches(gs, self.x)[:, ::-1, ::-1].reshape(-1, self.kh * self.kw * self.cout)
            gw = outer(met, self.x.reshape(-1, self.cin), 256, None)
            return adds(before, gw.reshape(self.kh, self.kw, self.cout, self.cin).swapaxes(2, 3))
        coarse, fine = (self.x, gs) if self.transposed else (gs, self.x)
        rows, met = coarse.reshape(-1, coarse.shape[3]), self.patches(fine, coarse)
        piece = max(1, 256 // (gs.shape[1] * gs.shape[2])) * coarse.shape[1] * coarse.shape[2]
        return outer(rows, met, piece, before) if self.transposed else outer(met, rows, piece, before)

    def patches(self, fine, coarse):
        """[pixels of the coarse map, kh, kw, channels]: what its taps meet of the fine one, zeros in the padding."""
        fine = np.lib.stride_tricks.sliding_window_view(self.padded(fine), (self.kh, self.kw), axis=(1, 2))
        fine = fine[:, ::self.stride[0], ::self.stride[1]][:, :coarse.shape[1], :coarse.shape[2]]
        return fine.transpose(0, 1, 2, 4, 5, 3).reshape(-1, self.kh, self.kw, fine.shape[3])


def product_reverse(s, x, y, gy, old):
    gs = gy if s["slope"] == 1 else np.where(y > 0, gy, F4(s["slope"]) * gy)
    conv = Conv(s, *x[:2])
    return conv.grad_x(gs, old[0]), conv.grad_w(gs, old[1]), (
        outer(np.ones((gs.size // conv.cout, 1), F4), gs.reshape(-1, conv.cout), 256, old[2]))


# ---- 4. Winograd's way
def times(factor, v):
    return fma(F4(factor), v, ZERO)


def filter_transform(g):
    e, m, a = g[0] + g[2], times(1 / 12, g[1]), fma(F4(1 / 24), g[0], times(1 / 6, g[2]))
    return times(0.25, g[0]), times(-1 / 6, e + g[1]), times(-1 / 6, e - g[1]), a + m, a - m, g[2]


def filter_grad_transform(u):
    a, n, d = u[3] + u[4], times(1 / 6, u[1] + u[2]), times(1 / 6, u[1] - u[2])
    e = fma(F4(1 / 24), a, times(0.25, u[0]))
    return e - n, times(1 / 12, u[3] - u[4]) - d, times(1 / 6, a) - n + u[5]


def patch_transform(d):
    e, o, t, i = fma(F4(-4), d[2], d[4]), fma(F4(-4), d[1], d[3]), d[4] - d[2], d[3] - d[1]
    return (fma(F4(4), d[0], fma(F4(-5), d[2], d[4])), e + o, e - o, fma(F4(2), i, t), fma(F4(-2), i, t),
            fma(F4(4), d[1], fma(F4(-5), d[3], d[5])))


def square_transform(m):
    e, o, e2, o2 = m[1] + m[2], m[1] - m[2], m[3] + m[4], m[3] - m[4]
    return m[0] + e + e2, fma(F4(2), o2, o), fma(F4(4), e2, e), fma(F4(8), o2, o) + m[5]


def square_grad_transform(g):
    e, o, e2, h = g[0] + g[2], g[1] + g[3], fma(F4(4), g[2], g[0]), fma(F4(4), g[3], g[1])
    return g[0], e + o, e - o, fma(F4(2), h, e2), fma(F4(-2), h, e2), g[3]


def both_ways(transform, a):
    """Each row, then each column."""
    columns = [transform(column) for column in zip(*(transform(row) for row in a))]
    return np.array(columns).swapaxes(0, 1)


def tiles(x, margin):
    """[side,side,tiles,channels]: the squares of 4x4 pixels with a margin around."""
    side, channels = 4 + 2 * margin, x.shape[3]
    x = np.pad(x, ((0, 0), (margin, margin), (margin, margin), (0, 0)))
    squares = np.lib.stride_tricks.sliding_window_view(x, (side, side), axis=(1, 2))[:, ::4, ::4]
    return squares.transpose(4, 5, 0, 1, 2, 3).reshape(side, side, -1, channels)


def winograd(x, w):
    u, v, m = both_ways(filter_transform, w), both_ways(patch_transform, tiles(x, 1)), ZERO
    for c in range(w.shape[2]):
        m = fma(v[..., c:c + 1], u[:, :, None, c], m)
    n, high, wide, _ = x.shape
    y = both_ways(square_transform, m).reshape(4, 4, n, high // 4, wide // 4, -1)
    return y.transpose(2, 3, 0, 4, 1, 5).reshape(n, high, wide, -1)


def winograd_grad_w(x, gs):
    v, m = both_ways(patch_transform, tiles(x, 1)), both_ways(square_grad_transform, tiles(gs, 0))
    return both_ways(filter_grad_transform, outer(np.moveaxis(v, 2, 0), np.moveaxis(m, 2, 0), 64, None))


# ---- 5. SSIM
GAUSSIAN = 1, 0.80073740291680806, 0.41111229050718745, 0.1353352832366127, 0.028565500784550377, 0.0038659201394728076


class Ssim:
    """Of one picture and its target, [H,W,1] both."""

    def __init__(self, x, target):
        x, target = x[..., 0], target[..., 0]
        side = min(x.shape)
        size = 11 if side >= 11 else min(7, (side - 1) // 2 * 2 + 1)
        values = np.array([GAUSSIAN[abs(i - 5)] if size == 11 else 1.0 for i in range(size)])
        self.weights = (values / in_order(values, 0)).astype(F4)
        self.rows, self.columns = x.shape[0] - size + 1, x.shape[1] - size + 1
        mean, mean_of_target = F4(sum16(x) / x.size), F4(sum16(target) / x.size)
        self.a, self.b = x - mean, target - mean_of_target
        self.mean_a, self.mean_b = self.blur(self.a), self.blur(self.b)
        self.ma, self.mb = self.mean_a + mean, self.mean_b + mean_of_target
        self.va = self.blur(self.a * self.a) - self.mean_a * self.mean_a
        vb = self.blur(self.b * self.b) - self.mean_b * self.mean_b
        covariance = self.blur(self.a * self.b) - self.mean_a * self.mean_b
        self.n1, self.n2 = F4(2) * self.ma * self.mb + F4(0.01 * 0.01), F4(2) * covariance + F4(0.03 * 0.03)
        self.d1 = self.ma * self.ma + self.mb * self.mb + F4(0.01 * 0.01)
        self.d2 = np.maximum(self.va, ZERO) + np.maximum(vb, ZERO) + F4(0.03 * 0.03)
        self.s = (self.n1 * self.n2) / (self.d1 * self.d2)
        self.value = in_order(self.s.ravel().astype(F8), 0) / self.s.size

    def blur(self, picture):
        columns = sum((w * picture[k:k + self.rows] for k, w in enumerate(self.weights)), ZERO)
        return sum((w * columns[:, k:k + self.columns] for k, w in enumerate(self.weights)), ZERO)

    def gradient(self, g, gx):
        g, gx = g / F4(self.s.size), gx.copy()
        by_mean = F4(2) * (self.mb * self.n2 / (self.d1 * self.d2) - self.ma * self.s / self.d1)
        by_var = np.where(self.va > 0, -self.s / self.d2, ZERO)
        by_cov = F4(2) * self.n1 / (self.d1 * self.d2)
        by_x = by_mean - F4(2) * self.mean_a * by_var - self.mean_b * by_cov
        for part, factor in ((g * by_x, np.ones_like(gx)), (g * F4(2) * by_var, self.a), (g * by_cov, self.b)):
            columns = np.zeros((self.rows, gx.shape[1]), F4)
            for k, w in enumerate(self.weights):
                columns[:, k:k + self.columns] += w * part
            for y, k in np.ndindex(self.rows, len(self.weights)):
                gx[y + k] += self.weights[k] * columns[y] * factor[y + k]
        return gx


# ---- 6. From gradients to the next state
def tree(parts):
    half = 1 << max(0, (len(parts) - 1).bit_length() - 1)
    return parts[0] if len(parts) == 1 else tree(parts[:half]) + tree(parts[half:])


def power(base, exponent):
    result = 1.0
    while exponent:
        result *= base if exponent & 1 else 1.0
        base, exponent = base * base, exponent >> 1
    return result


def adam(s, x, m, v, gradient):
    g = F4(s["clip_norm"] / s["norm"] if 0 < s["clip_norm"] < s["norm"] else 1) * gradient
    rate = F4(s["learning_rate"] / (1 - power(s["beta1"], s["step"])))
    correction = F4(1 / np.sqrt(1 - power(s["beta2"], s["step"])))
    m, v = F4(s["beta1"]) * m + F4(1 - s["beta1"]) * g, F4(s["beta2"]) * v + F4(1 - s["beta2"]) * g * g
    m, v = (np.where(np.abs(moment) < F4(1e-30), ZERO, moment) for moment in (m, v))
    return x - rate * m / (np.sqrt(v) * correction + F4(s["epsilon"])), m, v


# ---- Operators: y of the inputs; the terms of their gradients, of gy; whole gradients, where the order of sums matters
def by_channel(x):  # the pixels one after the other
    return x.reshape(len(x), -1, x.shape[-1]).swapaxes(0, 1)


FORWARD = {
    "add": lambda s, a, b: a + b,
    "multiply": lambda s, a, b: a * b,
    "scale": lambda s, x: F4(s["factor"]) * x,
    "sigmoid": lambda s, x: sigmoid(x),
    "clamp": lambda s, x: np.minimum(np.maximum(x, F4(s["low"])), F4(s["high"])),
    "take_runs": lambda s, x: np.concatenate([x[..., at:at + s["run"]] for at in range(
        s["first"], s["first"] + s["shape"][-1] // s["run"] * s["step"], s["step"])], axis=-1),
    "last_frame": lambda s, x: x[:, -1],
    "concat": lambda s, *parts: np.concatenate(parts, axis=-1),
    "flatten_channels_first": lambda s, x: np.moveaxis(x, -1, 1) + ZERO,
    "unflatten_channels_first": lambda s, x: np.moveaxis(x.reshape(len(x), s["shape"][-1], -1), 1, -1) + ZERO,
    "global_mean": lambda s, x: in_order(by_channel(x), ZERO) / F4(x.shape[1] * x.shape[2]),
    "gated_sum": lambda s, a, x, gate: a + x * gate[:, None, None],
    "sample_gaussian": lambda s, mean, log_var, eps: mean + exp(log_var / F4(2)) * eps,
    "kl_divergence": lambda s, m, v: F4(-0.5 * sum16(F4(1) + v - m * m - exp(v)) / len(m)),
    "l2_loss": lambda s, x, to: F4(sum16((x.astype(F8) - to) ** 2) / x.size),
    "ssim": lambda s, x, to: F4(in_order(np.array([Ssim(*pair).value for pair in zip(x, to)]), 0) / len(x)),
    "add_as_tree": lambda s, *parts: tree(parts) + ZERO,
    "norm": lambda s, *gradients: np.sqrt(in_order(np.array([sum16(g.astype(F8) ** 2) for g in gradients]), 0)),
    "adam": adam,
}
TERMS = {
    "add": lambda s, x, y, gy: (gy, gy),
    "multiply": lambda s, x, y, gy: (gy * x[1], gy * x[0]),
    "scale": lambda s, x, y, gy: (F4(s["factor"]) * gy,),
    "sigmoid": lambda s, x, y, gy: (gy * y * (F4(1) - y),),
    "clamp": lambda s, x, y, gy: (np.where((x[0] >= F4(s["low"])) & (x[0] <= F4(s["high"])), gy, ZERO),),
    "concat": lambda s, x, y, gy: np.split(gy, np.cumsum([part.shape[-1] for part in x])[:-1], axis=-1),
    "flatten_channels_first": lambda s, x, y, gy: (
        np.moveaxis(gy.reshape(len(gy), x[0].shape[-1], *x[0].shape[1:-1]), 1, -1),),
    "unflatten_channels_first": lambda s, x, y, gy: (np.moveaxis(gy, -1, 1).reshape(x[0].shape),),
    "global_mean": lambda s, x, y, gy: ((gy / F4(x[0].shape[1] * x[0].shape[2]))[:, None, None],),
    "sample_gaussian": lambda s, x, y, gy: (gy, gy * (y - x[0]) / F4(2)),
    "kl_divergence": lambda s, x, y, gy: (gy / F4(len(x[0])) * x[0],
                                          gy / F4(len(x[0])) * (exp(x[1]) - F4(1)) / F4(2)),
    "l2_loss": lambda s, x, y, gy: (F4(2) * gy / F4(x[0].size) * (x[0] - x[1]),
                                    F4(2) * gy / F4(x[0].size) * (x[1] - x[0])),
}
WHOLE = {
    "ssim": lambda s, x, y, gy, old: [[Ssim(a, b).gradient(gy / F4(len(x[0])), g[..., 0])
                                       for a, b, g in zip(*x, start_of(old[0], x[0]))]],
    "gated_sum": lambda s, x, y, gy, old: (adds(old[0], gy, -ZERO), adds(old[1], gy * x[2][:, None, None], -ZERO),
                                           in_order(by_channel(gy * x[1]), start_of(old[2], x[2]))),
}


def computed(ran, arrays):
    op, s = ran["op"], {**ran.get("settings", {}), "op": ran["op"]}
    x = [arrays[name] for name in ran["inputs"]]
    if "gy" not in ran:
        found = FORWARD[op](s, *x) if op in FORWARD else Conv(s, *x[:2]).forward(x[2])
        return found if isinstance(found, tuple) else (found,)
    y, gy, old = arrays[ran["y"]], arrays[ran["gy"]], [arrays[name] if name else None for name in ran["before"]]
    if op in TERMS:
        terms = [np.broadcast_to(term, of.shape) for term, of in zip(TERMS[op](s, x, y, gy), x)]
        return [adds(before, term, ZERO if "flatten" in op else -ZERO) for before, term in zip(old, terms)]
    return WHOLE.get(op, product_reverse)(s, x, y, gy, old)


def main():
    if sys.argv[1:] in ([], ["-h"], ["--help"]):
        print(__doc__)
        sys.exit(0 if sys.argv[1:] else 2)
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    operators, arrays = read(sys.argv[1])
    judged = entries = wrong = 0
    for ran in operators:
        if not ran.get("inputs") or not any(ran["outputs"]) or ran["op"] == "muon":  # it made nothing, or from nothing
            continue
        judged, outputs = judged + 1, zip(ran["outputs"], computed(ran, arrays))
        for k, (name, result) in enumerate(outputs):
            if not name:
                continue  # a gradient that nobody wanted
            expected = np.array(ran["value"]) if ran["op"] == "norm" else arrays[name]
            bits, result = f"u{expected.itemsize}", np.ascontiguousarray(result, expected.dtype).reshape(expected.shape)
            differ = np.argwhere(result.view(bits) != expected.view(bits))
            entries, wrong = entries + expected.size, wrong + len(differ)
            for at in map(tuple, differ[:1].tolist()):
                print(f"{ran.get('of', '')} {ran['name']} ({ran['op']}), output {k}: {len(differ)} of {expected.size}"
                      f" entries differ, first {list(at)}: {expected[at]}, computed {result[at]}")
    muon = "; what Muon moved is not judged" if any(ran["op"] == "muon" for ran in operators) else ""
    print(f"{judged} operators, {entries} entries, {wrong} differ{muon}")
    sys.exit(1 if wrong or not judged else 0)  # nothing judged is no agreement


if __name__ == "__main__":
    with np.errstate(all="ignore"):
        main()
