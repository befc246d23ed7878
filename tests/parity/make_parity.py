#!/usr/bin/python3
"""Writes parity.safetensors and ops.safetensors: what PyTorch computes, in float64, for single ops and for networks of
preset `paper`: outputs at its own sizes; gradients and ten steps of Adam, clipped, at T 32 and LD 3.

    /usr/bin/python3 tests/parity/make_parity.py tests/parity      (Debian: python3-torch, python3-numpy)

Parameters and the large inputs are not stored: both sides compute them from name and element number with
`counter_numbers` (24 random bits times a power of two, so float32 holds them exactly). Of long gradients every
13th element is stored (13 shares no factor with any dimension: every tap and channel is met) and, as
`.projection`, their sum weighted with counter_numbers(name + ".projection"), which no wrong element escapes.
"""
import math
import pathlib
import sys

import numpy as np
import torch
import torch.nn.functional as F

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "python"))
from supertac.files import write  # noqa: E402
from supertac.model import groups_of  # noqa: E402
from supertac.torch_model import SuperTac, kl_divergence, loss_terms, ssim  # noqa: E402

MASK = (1 << 64) - 1
SAMPLE_ABOVE, SAMPLE_STRIDE = 1024, 13
A, BETA, LAMBDA, RATE, CLIP, STEPS = 0.5, 1e-3, 0.1, 1e-3, 0.55, 10


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


def network(T, LD, scale, grouping="horizontal"):
    """With parameters uniform within the power of two at or below 1/sqrt(elements per output), biases within 1/8."""
    settings = {"timesteps": T, "latent": LD, "scale": scale, "channels": 32, "rcabs": 3, "grouping": grouping,
                "spread": True}
    net = SuperTac(settings, {}, groups_of(settings))
    for name, parameter in net.named_parameters():
        fan_in = math.prod(parameter.shape[1:])
        bound = 0.125 if parameter.dim() == 1 else 2.0 ** math.floor(-math.log2(fan_in) / 2)
        parameter.data = tensor(name, parameter.shape, bound)
    return net


def sampled(name, values):
    """What is stored of a long tensor: every 13th element, and a weighted sum of all."""
    flat = values.detach().numpy().reshape(-1)
    kept = flat[:: SAMPLE_STRIDE if flat.size > SAMPLE_ABOVE else 1].astype(np.float32)
    projection = np.array([flat @ counter_numbers(name + ".projection", flat.size)])
    return kept, projection


def outputs(prefix, out):
    stored = {f"{prefix}.{key}": torch.stack(out[key]) for key in ("mean", "log_var", "decoded")}
    stored[f"{prefix}.sr"], stored[f"{prefix}.spread"] = out["picture"], out["predicted_error"]
    return {key: value.detach().numpy() for key, value in stored.items()}


def small_case():
    """T 32, LD 3, scale 4, batch 4: everything."""
    N, T, LD, scale = 4, 32, 3, 4
    net = network(T, LD, scale)
    initial = {name: value.detach().clone() for name, value in net.named_parameters()}
    windows = (tensor("small.windows", (N, T, 16)) + 1) / 2
    eps = tensor("small.eps", (STEPS, 4, N, LD), 2.0)
    y, x = torch.meshgrid(torch.arange(16.0), torch.arange(16.0), indexing="ij")
    phase = torch.arange(float(N))[:, None, None]
    truth = (0.5 + 0.4 * torch.sin(0.7 * y + phase) * torch.cos(0.3 * x - phase)).double().float().double()
    truth[-1] = 0.25  # a flat one, whose structure the loss leaves out
    stored = {"small.windows": windows.numpy(), "small.eps": eps.numpy(), "small.truth": truth.numpy()}
    adam = torch.optim.Adam(net.parameters(), lr=RATE)
    losses, norms = [], []
    for step in range(STEPS):
        out = net.training_outputs(windows, eps[step])
        terms = loss_terms(out, truth, A, BETA, LAMBDA)
        adam.zero_grad()
        terms["total"].backward()
        if step == 0:
            stored.update(outputs("small", out))
            stored.update({f"small.loss.{key}": np.array(value.item()) for key, value in terms.items()})
            for name, value in net.named_parameters():
                kept, projection = sampled(name, value.grad)
                stored["small.grad." + name], stored[f"small.grad.{name}.projection"] = kept, projection
        losses.append(terms["total"].item())
        norm = math.sqrt(sum(float((p.grad**2).sum()) for p in net.parameters()))
        norms.append(norm)
        for parameter in net.parameters():  # clip_grad_norm_ adds 1e-6 to the norm
            parameter.grad *= min(1, CLIP / norm)
        adam.step()
    stored["small.adam.losses"], stored["small.adam.norms"] = np.array(losses), np.array(norms)
    for name, value in net.named_parameters():
        kept, projection = sampled(name, value - initial[name])
        stored["small.change." + name], stored[f"small.change.{name}.projection"] = kept, projection
    with torch.no_grad():
        stored["small.frame.sr"] = network(1, LD, scale).draw(windows[:, -1:]).picture.numpy()
        stored["small.vertical.sr"] = network(T, LD, scale, "vertical").draw(windows).picture.numpy()
    return stored


def full_case():
    """T 256, LD 10, scale 4, batch 2: outputs of the evaluation (z = mean)."""
    N, T, LD, scale = 2, 256, 10, 4
    windows = (tensor("full.windows", (N, T, 16)) + 1) / 2
    with torch.no_grad():
        return outputs("full", network(T, LD, scale).training_outputs(windows))


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
    case("conv2d_leaky", lambda x, w, b: F.leaky_relu(F.conv2d(x, w, b, padding=1)), x=(2, 3, 5, 7), w=(17, 3, 3, 3), b=(17,))
    case("linear", lambda x, w, b: F.linear(x, w, b), x=(3, 33), w=(17, 33), b=(17,))
    case("linear_relu", lambda x, w, b: F.relu(F.linear(x, w, b)), x=(3, 33), w=(17, 33), b=(17,))
    case("l2_loss", lambda x, target: F.mse_loss(x, target), x=(2, 5, 3), target=(2, 5, 3))
    case("kl_divergence", kl_divergence, mean=(3, 4), log_var=(3, 4))
    case("ssim", lambda x: ssim(x, tensor("ssim.target", (2, 16, 13)).abs()), x=(2, 16, 13))
    case("ssim8", lambda x: ssim(x, tensor("ssim8.target", (2, 8, 9)).abs()), x=(2, 8, 9))
    case("sample_gaussian", lambda mean, log_var: mean + torch.exp(log_var / 2) * tensor("sample_gaussian.eps", (3, 4)),
         mean=(3, 4), log_var=(3, 4))
    case("max_pool2d", lambda x: F.max_pool2d(x, 2), x=(2, 3, 5, 4))
    case("gated_sum", lambda a, x, s: a + x * s[:, :, None, None], a=(2, 3, 4, 5), x=(2, 3, 4, 5), s=(2, 3))
    case("global_mean", lambda x: x.mean((2, 3)), x=(2, 3, 4, 5))
    case("sigmoid", lambda x: torch.sigmoid(x), x=(3, 33))
    case("relu", lambda x: F.relu(x), x=(3, 33))
    case("leaky_relu", lambda x: F.leaky_relu(x), x=(3, 33))
    case("clamp", lambda x: x.clamp(-0.5, 0.25), x=(3, 33))
    case("add", lambda a, b: a + b, a=(3, 33), b=(3, 33))
    case("multiply", lambda a, b: a * b, a=(3, 33), b=(3, 33))
    case("scale", lambda x: -3 * x, x=(3, 33))
    case("subtract", lambda a, b: 2 - (a - b), a=(3, 33), b=(3, 33))
    case("sum", lambda x: x.sum(), x=(3, 33))
    case("concat", lambda x0, x1: torch.cat((x0, x1), -1), x0=(2, 3, 4), x1=(2, 3, 17))
    case("flatten", lambda x: x.flatten(1), x=(2, 4, 3, 5))
    case("unflatten", lambda x: x.reshape(2, 3, 2, 3), x=(2, 18))
    case("softmax_cross_entropy", lambda logits: F.cross_entropy(logits, torch.tensor([2, 0, 6])), logits=(3, 7))
    return stored


if __name__ == "__main__":
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    np.seterr(over="ignore")
    folder = sys.argv[1] if len(sys.argv) > 1 else "."
    write(folder + "/parity.safetensors", {**small_case(), **full_case()})
    write(folder + "/ops.safetensors", op_cases())
