#!/usr/bin/python3
"""Writes parity.safetensors and ops.safetensors: what PyTorch computes, in float64, for the preset `paper`.

    /usr/bin/python3 tests/parity/make_parity.py tests/parity      (Debian: python3-torch, python3-numpy)

Parameters and the large inputs are not stored: both sides compute them from name and element number with
`counter_numbers` (24 random bits times a power of two, so float32 holds them exactly). Of long gradients every
13th element is stored (13 shares no factor with any dimension: every tap and channel is met) and, as
`.projection`, their sum weighted with counter_numbers(name + ".projection"), which no wrong element escapes.
"""
import json
import math
import struct
import sys

import numpy as np
import torch
import torch.nn.functional as F

MASK = (1 << 64) - 1
SAMPLE_ABOVE, SAMPLE_STRIDE = 1024, 13
A, BETA, LAMBDA, RATE, STEPS = 0.5, 1e-3, 0.1, 1e-3, 10


def counter_numbers(name, count, bound=1.0):
    """bound * uniform [-1,1): splitmix64 of (FNV-1a of the name + counter), its upper 24 bits."""
    key = 0xCBF29CE484222325
    for byte in name.encode():
        key = ((key ^ byte) * 0x100000001B3) & MASK
    z = np.uint64(key) + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return bound * ((z >> np.uint64(40)).astype(np.float64) * 2.0**-23 - 1)


def tensor(name, shape, bound=1.0):
    return torch.from_numpy(counter_numbers(name, math.prod(shape), bound).reshape(shape))


def save(path, tensors):
    """safetensors: 8-byte length, JSON header, data."""
    header, data = {}, b""
    for name, array in tensors.items():
        raw = np.ascontiguousarray(array).tobytes()
        dtype = {"float32": "F32", "float64": "F64"}[str(array.dtype)]
        header[name] = {"dtype": dtype, "shape": list(array.shape), "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + data)


def parameter_shapes(T, LD, scale):
    shapes = {}

    def layer(name, weight, out):
        shapes[name + ".weight"], shapes[name + ".bias"] = weight, (out,)

    flat = 32 * T // 16
    for i in range(4):
        for j, (a, b) in enumerate([(4, 16), (16, 32), (32, 32), (32, 32)]):
            layer(f"encoder.{i}.conv.{j}", (b, a, 3), b)
        layer(f"encoder.{i}.fc", (64, flat), 64)
        layer(f"encoder.{i}.mean", (LD, 64), LD)
        layer(f"encoder.{i}.log_var", (LD, 64), LD)
        layer(f"decoder.{i}.fc.0", (64, LD), 64)
        layer(f"decoder.{i}.fc.1", (flat, 64), flat)
        for j, (a, b) in enumerate([(32, 32), (32, 32), (32, 16), (16, 16)]):
            layer(f"decoder.{i}.conv.{j}", (a, b, 4), b)
        layer(f"decoder.{i}.out", (4, 16, 3), 4)
    layer("upsampler.fc", (512, 4 * LD), 512)
    for j in range(int(math.log2(scale))):
        rirb = f"upsampler.rirb.{j}"
        for k in range(3):
            for c in range(2):
                layer(f"{rirb}.rcab.{k}.conv.{c}", (32, 32, 3, 3), 32)
            layer(f"{rirb}.rcab.{k}.attention.squeeze", (8, 32, 1, 1), 8)
            layer(f"{rirb}.rcab.{k}.attention.expand", (32, 8, 1, 1), 32)
        layer(f"{rirb}.conv", (32, 32, 3, 3), 32)
        layer(f"{rirb}.up", (32, 32, 4, 4), 32)
    layer("upsampler.out", (1, 32, 3, 3), 1)
    return shapes


def initial_parameters(T, LD, scale):
    """uniform within the power of two at or below 1/sqrt(elements per output), biases within 1/8"""
    parameters = {}
    for name, shape in parameter_shapes(T, LD, scale).items():
        fan_in = math.prod(shape[1:])
        bound = 0.125 if len(shape) == 1 else 2.0 ** math.floor(-math.log2(fan_in) / 2)
        parameters[name] = tensor(name, shape, bound).requires_grad_()
    return parameters


def taxels(i, grouping):
    return [4 * i + k for k in range(4)] if grouping == "horizontal" else [i + 4 * k for k in range(4)]


def forward(p, windows, eps, scale, grouping="horizontal"):
    def at(name):
        return p[name + ".weight"], p[name + ".bias"]

    out = {"mean": [], "log_var": [], "decoded": [], "input": []}
    zs = []
    for i in range(4):
        x = windows[:, :, taxels(i, grouping)].transpose(1, 2)
        h = x
        for j in range(4):
            h = F.leaky_relu(F.conv1d(h, *at(f"encoder.{i}.conv.{j}"), stride=2, padding=1), 0.01)
        h = F.relu(F.linear(h.flatten(1), *at(f"encoder.{i}.fc")))
        mean = F.linear(h, *at(f"encoder.{i}.mean"))
        log_var = F.linear(h, *at(f"encoder.{i}.log_var")).clamp(-10, 10)
        z = mean if eps is None else mean + torch.exp(log_var / 2) * eps[i]
        zs.append(z)
        d = F.relu(F.linear(z, *at(f"decoder.{i}.fc.0")))
        d = F.relu(F.linear(d, *at(f"decoder.{i}.fc.1"))).reshape(len(z), 32, -1)
        for j in range(4):
            d = F.leaky_relu(F.conv_transpose1d(d, *at(f"decoder.{i}.conv.{j}"), stride=2, padding=1), 0.01)
        d = torch.sigmoid(F.conv1d(d, *at(f"decoder.{i}.out"), padding=1))
        for key, value in zip(out, (mean, log_var, d.transpose(1, 2), x.transpose(1, 2))):
            out[key].append(value)
    h = F.leaky_relu(F.linear(torch.cat(zs, 1), *at("upsampler.fc")), 0.01).reshape(-1, 32, 4, 4)
    for j in range(int(math.log2(scale))):
        rirb, skip = f"upsampler.rirb.{j}", h
        for k in range(3):
            rcab = f"{rirb}.rcab.{k}"
            r = F.conv2d(F.relu(F.conv2d(h, *at(rcab + ".conv.0"), padding=1)), *at(rcab + ".conv.1"), padding=1)
            gate = F.relu(F.conv2d(r.mean((2, 3), keepdim=True), *at(rcab + ".attention.squeeze")))
            h = h + r * torch.sigmoid(F.conv2d(gate, *at(rcab + ".attention.expand")))
        h = skip + F.conv2d(h, *at(rirb + ".conv"), padding=1)
        h = F.leaky_relu(F.conv_transpose2d(h, *at(rirb + ".up"), stride=2, padding=1), 0.01)
    out["sr"] = F.conv2d(h, *at("upsampler.out"), padding=1)[:, 0]
    return out


def ssim(x, y):
    """Wang 2004 on [N,H,W]: Gaussian 11x11, sigma 1.5 (7x7 uniform below 11 pixels), K .01 .03, range 1, valid."""
    if min(x.shape[1:]) < 11:
        window = torch.full((7, 7), 1 / 49, dtype=x.dtype)
    else:
        g = torch.exp(-(torch.arange(11, dtype=x.dtype) - 5) ** 2 / (2 * 1.5**2))
        window = torch.outer(g, g) / g.sum() ** 2

    def blur(image):
        return F.conv2d(image[:, None], window[None, None])[:, 0]

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mx * my + c1) * (2 * cov + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))).mean()


def kld(mean, log_var):
    return -0.5 * (1 + log_var - mean**2 - log_var.exp()).sum(1).mean()


def loss_terms(out, truth):
    terms = {
        "reconstruction": sum(F.mse_loss(d, x) for d, x in zip(out["decoded"], out["input"])),
        "kld": sum(kld(m, v) for m, v in zip(out["mean"], out["log_var"])),
        "l2": F.mse_loss(out["sr"], truth),
        "ssim": ssim(out["sr"], truth),
    }
    terms["total"] = A * (terms["reconstruction"] + BETA * terms["kld"]) + (1 - A) * (
        terms["l2"] + LAMBDA * (1 - terms["ssim"])
    )
    return terms


def sampled(name, values):
    """What is stored of a long tensor: every 13th element, and a weighted sum of all."""
    flat = values.detach().numpy().reshape(-1)
    kept = flat[:: SAMPLE_STRIDE if flat.size > SAMPLE_ABOVE else 1].astype(np.float32)
    projection = np.array([flat @ counter_numbers(name + ".projection", flat.size)])
    return kept, projection


def outputs(prefix, out):
    stored = {f"{prefix}.{key}": torch.stack(out[key]) for key in ("mean", "log_var", "decoded")}
    stored[f"{prefix}.sr"] = out["sr"]
    return {key: value.detach().numpy() for key, value in stored.items()}


def small_case():
    """T 32, LD 3, scale 4, batch 4: everything."""
    N, T, LD, scale = 4, 32, 3, 4
    p = initial_parameters(T, LD, scale)
    initial = {name: value.detach().clone() for name, value in p.items()}
    windows = (tensor("small.windows", (N, T, 16)) + 1) / 2
    eps = tensor("small.eps", (STEPS, 4, N, LD), 2.0)
    y, x = torch.meshgrid(torch.arange(16.0), torch.arange(16.0), indexing="ij")
    phase = torch.arange(float(N))[:, None, None]
    truth = (0.5 + 0.4 * torch.sin(0.7 * y + phase) * torch.cos(0.3 * x - phase)).double().float().double()
    stored = {"small.windows": windows.numpy(), "small.eps": eps.numpy(), "small.truth": truth.numpy()}
    adam = torch.optim.Adam(p.values(), lr=RATE)
    losses = []
    for step in range(STEPS):
        out = forward(p, windows, eps[step], scale)
        terms = loss_terms(out, truth)
        adam.zero_grad()
        terms["total"].backward()
        if step == 0:
            stored.update(outputs("small", out))
            stored.update({f"small.loss.{key}": np.array(value.item()) for key, value in terms.items()})
            for name, value in p.items():
                kept, projection = sampled(name, value.grad)
                stored["small.grad." + name], stored[f"small.grad.{name}.projection"] = kept, projection
        losses.append(terms["total"].item())
        adam.step()
    stored["small.adam.losses"] = np.array(losses)
    for name, value in p.items():
        kept, projection = sampled(name, value - initial[name])
        stored["small.change." + name], stored[f"small.change.{name}.projection"] = kept, projection
    with torch.no_grad():
        stored["small.vertical.sr"] = forward(initial, windows, None, scale, "vertical")["sr"].numpy()
    return stored


def full_case():
    """T 256, LD 10, scale 4, batch 2: outputs of the evaluation (z = mean)."""
    N, T, LD, scale = 2, 256, 10, 4
    windows = (tensor("full.windows", (N, T, 16)) + 1) / 2
    with torch.no_grad():
        return outputs("full", forward(initial_parameters(T, LD, scale), windows, None, scale))


def op_cases():
    """y and the gradients of sum(y * r) for single ops, PyTorch's layouts."""
    stored = {}

    def case(name, f, **shapes):
        inputs = {key: tensor(f"{name}.{key}", shape).requires_grad_() for key, shape in shapes.items()}
        y = f(**inputs)
        (y * tensor(name + ".r", tuple(y.shape))).sum().backward()
        stored[name + ".y"] = y.detach().numpy()
        stored.update({f"{name}.{key}.grad": value.grad.numpy() for key, value in inputs.items()})

    case("conv1d", lambda x, w, b: F.conv1d(x, w, b, stride=2, padding=1), x=(2, 3, 9), w=(5, 3, 3), b=(5,))
    case("conv2d", lambda x, w, b: F.conv2d(x, w, b, stride=2, padding=1), x=(2, 3, 5, 7), w=(17, 3, 3, 3), b=(17,))
    case("conv_transpose1d", lambda x, w, b: F.conv_transpose1d(x, w, b, stride=2, padding=1), x=(2, 3, 5), w=(3, 5, 4), b=(5,))
    case("conv_transpose2d", lambda x, w, b: F.conv_transpose2d(x, w, b, stride=2, padding=1), x=(2, 3, 4, 3), w=(3, 5, 4, 4), b=(5,))
    case("linear", lambda x, w, b: F.linear(x, w, b), x=(3, 33), w=(17, 33), b=(17,))
    case("l2_loss", lambda x, target: F.mse_loss(x, target), x=(2, 5, 3), target=(2, 5, 3))
    case("kl_divergence", kld, mean=(3, 4), log_var=(3, 4))
    case("ssim", lambda x: ssim(x, tensor("ssim.target", (2, 16, 13)).abs()), x=(2, 16, 13))
    case("ssim8", lambda x: ssim(x, tensor("ssim8.target", (2, 8, 9)).abs()), x=(2, 8, 9))
    case("softmax_cross_entropy", lambda logits: F.cross_entropy(logits, torch.tensor([2, 0, 6])), logits=(3, 7))
    return stored


if __name__ == "__main__":
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    np.seterr(over="ignore")
    folder = sys.argv[1] if len(sys.argv) > 1 else "."
    save(folder + "/parity.safetensors", {**small_case(), **full_case()})
    save(folder + "/ops.safetensors", op_cases())
