"""SuperTac in PyTorch, from a checkpoint of ours. Tensors are looked up once and no layer objects are in the way:
a call costs what PyTorch's operators cost and little else."""
import json
import pathlib
import struct
import sys

import numpy as np
import torch
import torch.nn.functional as F

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests/parity"))
import make_parity  # noqa: E402


def read_safetensors(path):
    raw = pathlib.Path(path).read_bytes()
    size = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8 : 8 + size])
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = (8 + size + offset for offset in entry["data_offsets"])
        tensors[name] = np.frombuffer(raw[begin:end], np.float32).reshape(entry["shape"])
    return tensors, metadata


class SuperTac(torch.nn.Module):
    def __init__(self, path):
        super().__init__()
        tensors, metadata = read_safetensors(path)
        self.settings = json.loads(metadata["settings"])
        self.tensors = {name: torch.tensor(array) for name, array in tensors.items()}
        vertical = self.settings["grouping"] == "vertical"
        self.groups = [slice(i, None, 4) if vertical else slice(4 * i, 4 * i + 4) for i in range(4)]

        def layer(name):
            return self.tensors[name + ".weight"], self.tensors[name + ".bias"]

        def layers(pattern, *numbers):
            return [layer(pattern.format(n)) for n in numbers]

        self.encoders = [
            (layers(f"encoder.{i}.conv.{{}}", 0, 1, 2, 3), layer(f"encoder.{i}.fc"), layer(f"encoder.{i}.mean"),
             layer(f"encoder.{i}.log_var"))
            for i in range(4)
        ]
        self.decoders = [
            (layers(f"decoder.{i}.fc.{{}}", 0, 1), layers(f"decoder.{i}.conv.{{}}", 0, 1, 2, 3),
             layer(f"decoder.{i}.out"))
            for i in range(4)
        ]
        self.fc, self.rirbs = layer("upsampler.fc"), []
        # The picture and, where there is one, its spread: one convolution.
        outputs = [layer(name) for name in ("upsampler.out", "upsampler.spread") if name + ".weight" in self.tensors]
        self.out = torch.cat([w for w, _ in outputs]), torch.cat([b for _, b in outputs])
        self.channels = self.fc[0].shape[0] // 16
        while f"upsampler.rirb.{len(self.rirbs)}.up.weight" in self.tensors:
            rirb, rcabs = f"upsampler.rirb.{len(self.rirbs)}", []
            while f"{rirb}.rcab.{len(rcabs)}.conv.0.weight" in self.tensors:
                rcabs.append(layers(f"{rirb}.rcab.{len(rcabs)}.{{}}", "conv.0", "conv.1", "attention.squeeze",
                                    "attention.expand"))
            self.rirbs.append((rcabs, layer(f"{rirb}.conv"), layer(f"{rirb}.up")))

    def features(self, windows, i):
        convs, fc, _, _ = self.encoders[i]
        h = windows[:, :, self.groups[i]].transpose(1, 2)
        for w, b in convs:
            h = F.leaky_relu(F.conv1d(h, w, b, stride=2, padding=1), 0.01)
        return F.relu(F.linear(h.flatten(1), *fc))

    def decode(self, z, i):
        linears, convs, (w, b) = self.decoders[i]
        for linear in linears:
            z = F.relu(F.linear(z, *linear))
        h = z.reshape(z.shape[0], 32, -1)
        for cw, cb in convs:
            h = F.leaky_relu(F.conv_transpose1d(h, cw, cb, stride=2, padding=1), 0.01)
        return torch.sigmoid(F.conv1d(h, w, b, padding=1)).transpose(1, 2)

    def upsample(self, z):
        h = F.leaky_relu(F.linear(z, *self.fc), 0.01).reshape(-1, self.channels, 4, 4)
        for rcabs, (w, b), (up_w, up_b) in self.rirbs:
            skip = h
            for (w0, b0), (w1, b1), squeeze, expand in rcabs:
                r = F.conv2d(F.relu(F.conv2d(h, w0, b0, padding=1)), w1, b1, padding=1)
                gate = F.conv2d(F.relu(F.conv2d(r.mean((2, 3), keepdim=True), *squeeze)), *expand)
                h = h + r * torch.sigmoid(gate)
            h = skip + F.conv2d(h, w, b, padding=1)
            h = F.leaky_relu(F.conv_transpose2d(h, up_w, up_b, stride=2, padding=1), 0.01)
        return F.conv2d(h, *self.out, padding=1)

    def forward(self, windows):
        """Inference, z = mean: windows [N,T,16] -> [N,1 or 2,S,S], the picture and its spread."""
        return self.upsample(torch.cat([F.linear(self.features(windows, i), *self.encoders[i][2]) for i in range(4)], 1))

    def loss(self, windows, eps, truth, a=0.2, beta=1e-3, weight_ssim=0.1):
        """The training loss with the defaults of supertac-train; eps [4,N,LD], truth [N,S,S]."""
        vae, zs = 0, []
        for i in range(4):
            features = self.features(windows, i)
            mean = F.linear(features, *self.encoders[i][2])
            log_var = F.linear(features, *self.encoders[i][3]).clamp(-10, 10)
            z = mean + torch.exp(log_var / 2) * eps[i]
            vae = vae + F.mse_loss(self.decode(z, i), windows[:, :, self.groups[i]]) + beta * make_parity.kld(mean, log_var)
            zs.append(z)
        picture = self.upsample(torch.cat(zs, 1))[:, 0]
        return a * vae + (1 - a) * (F.mse_loss(picture, truth) + weight_ssim * (1 - make_parity.ssim(picture, truth)))


def count_macs(call):
    """Multiply-adds of the convolutions and linear layers that `call` runs, padding counted as data."""
    total, originals = 0, {}

    def counted(name):
        def run(x, w, *rest, **options):
            nonlocal total
            y = originals[name](x, w, *rest, **options)
            positions = x if "transpose" in name else y
            total += w.numel() * positions.numel() // positions.shape[0] // (w.shape[0])
            return y

        return run

    for name in ("linear", "conv1d", "conv2d", "conv_transpose1d", "conv_transpose2d"):
        originals[name] = getattr(F, name)
        setattr(F, name, counted(name))
    try:
        call()
    finally:
        for name, original in originals.items():
            setattr(F, name, original)
    return total
