"""The network as a torch.nn.Module. Names and layouts are those of the model file, so load_state_dict() takes it."""
from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import nn
from torch.nn import functional as F

from .model import BINS, LEAST_GAIN, REST_REMOVED, REST_SHARE, TOP_RANK, Pictures


REDUCTION = 4  # of the channels inside channel attention


def layers(**parts: nn.Module) -> nn.ModuleDict:
    return nn.ModuleDict(parts)


def encoder(signals: int, timesteps: int, latent: int) -> nn.ModuleDict:
    sizes = [signals, 16, 32, 32, 32]
    return layers(conv=nn.ModuleList(nn.Conv1d(a, b, 3, 2, 1) for a, b in zip(sizes, sizes[1:])),
                  fc=nn.Linear(2 * timesteps, 64), mean=nn.Linear(64, latent), log_var=nn.Linear(64, latent))


def decoder(signals: int, timesteps: int, latent: int) -> nn.ModuleDict:
    sizes = [32, 32, 32, 16, 16]
    return layers(fc=nn.ModuleList([nn.Linear(latent, 64), nn.Linear(64, 2 * timesteps)]),
                  conv=nn.ModuleList(nn.ConvTranspose1d(a, b, 4, 2, 1) for a, b in zip(sizes, sizes[1:])),
                  out=nn.Conv1d(16, signals, 3, padding=1))


def rcab(channels: int, squeezed: int) -> nn.ModuleDict:
    return layers(conv=nn.ModuleList(nn.Conv2d(channels, channels, 3, padding=1) for _ in range(2)),
                  attention=layers(squeeze=nn.Conv2d(channels, squeezed, 1), expand=nn.Conv2d(squeezed, channels, 1)))


def rirb(channels: int, squeezed: int, blocks: int) -> nn.ModuleDict:
    return layers(rcab=nn.ModuleList(rcab(channels, squeezed) for _ in range(blocks)),
                  conv=nn.Conv2d(channels, channels, 3, padding=1), up=nn.ConvTranspose2d(channels, channels, 4, 2, 1))


class SuperTac(nn.Module):
    """Of a model file's settings, with parameters that load_state_dict() takes from its tensors."""

    def __init__(self, settings: dict[str, Any], input_of_model: dict[str, Any], groups: list[Any]):
        super().__init__()
        s, self.input, self.map = settings, input_of_model, tuple(settings.get(name, 4) for name in ("rows", "columns"))
        self.groups = [torch.tensor(group) for group in groups]
        channels, count = s["channels"], len(groups)
        vae = len(groups[0]) if groups else 0, s["timesteps"], s["latent"]
        self.encoder = nn.ModuleList(encoder(*vae) for _ in range(count))
        self.decoder = nn.ModuleList(decoder(*vae) for _ in range(count))
        self.upsampler = layers(rirb=nn.ModuleList(rirb(channels, channels // REDUCTION, s["rcabs"])
                                                   for _ in range(s["scale"].bit_length() - 1)),
                                out=nn.Conv2d(channels, 1, 3, padding=1))
        if groups:
            self.upsampler["fc"] = nn.Linear(count * s["latent"], channels * self.map[0] * self.map[1])
        if s.get("spread"):
            self.upsampler["spread"] = nn.Conv2d(channels, 1, 3, padding=1)
        if s.get("last_frame_path") or not groups:
            self.upsampler["last_frame"] = nn.Conv2d(s.get("in_channels", 1), channels, 3, padding=1)

    def scale(self, volts: torch.Tensor) -> torch.Tensor:
        """Volts [N,T,S] -> what the network takes."""
        share = (self.input["rest_volts"] - volts.double()) / self.input["span_volts"]
        x = share.clamp(0, 1).float()
        return self.level(x) if self.input.get("levelled") else x

    @staticmethod
    def level(x: torch.Tensor) -> torch.Tensor:
        def bin_of(sample: torch.Tensor) -> torch.Tensor:
            return (sample * BINS).clamp(max=BINS - 1).floor() / BINS

        ordered = x.sort(dim=1).values
        removed = float(REST_REMOVED) * bin_of(ordered[:, x.shape[1] // REST_SHARE])
        swing = bin_of(ordered[:, x.shape[1] - TOP_RANK]) - removed
        gain = swing.amax(1).clamp(min=float(LEAST_GAIN))[:, None, None]
        return ((x - removed[:, None]) * (1 / gain)).clamp(0, 1)

    def distributions(self, x: torch.Tensor) -> Iterator[tuple[torch.Tensor, torch.Tensor]]:
        """Of each group's latents: mean and log variance [N,latent]."""
        for part, group in zip(self.encoder, self.groups):
            h = x[:, :, group].transpose(1, 2)
            for conv in part["conv"]:
                h = F.leaky_relu(conv(h), 0.01)
            h = F.relu(part["fc"](h.flatten(1)))
            yield part["mean"](h), part["log_var"](h).clamp(-10, 10)

    def decode(self, z: torch.Tensor, i: int) -> torch.Tensor:
        """Latents of group i -> its window [N,T,S of the group], as training asks it to."""
        part = self.decoder[i]
        h = F.relu(part["fc"][1](F.relu(part["fc"][0](z)))).reshape(len(z), 32, -1)
        for conv in part["conv"]:
            h = F.leaky_relu(conv(h), 0.01)
        return torch.sigmoid(part["out"](h)).transpose(1, 2)

    def upsample(self, latents: Any, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor | None]:
        up: Any = self.upsampler
        h: Any = 0
        if "fc" in up:
            h = F.leaky_relu(up["fc"](latents), 0.01).reshape(len(latents), -1, *self.map)
        if "last_frame" in up:
            h = h + F.leaky_relu(up["last_frame"](x[:, -1].reshape(len(x), *self.map, -1).movedim(-1, 1)), 0.01)
        for part in up["rirb"]:
            skip = h
            for block in part["rcab"]:
                r = block["conv"][1](F.relu(block["conv"][0](h)))
                squeezed = F.relu(block["attention"]["squeeze"](r.mean((2, 3), keepdim=True)))
                h = h + r * torch.sigmoid(block["attention"]["expand"](squeezed))
            h = F.leaky_relu(part["up"](skip + part["conv"](h)), 0.01)
        return up["out"](h)[:, 0], up["spread"](h)[:, 0] if "spread" in up else None

    def forward(self, volts: torch.Tensor) -> Pictures:
        return self.draw(self.scale(volts))

    def draw(self, x: torch.Tensor) -> Pictures:
        """Pictures of windows [N,T,S] that were scaled and normalised."""
        latents = torch.cat([mean for mean, _ in self.distributions(x)], 1) if self.groups else None
        return Pictures(*self.upsample(latents, x), latents)

    def training_outputs(self, x: torch.Tensor, eps: Any = None) -> dict[str, Any]:
        """What a training step looks at: lists over the groups, picture and predicted error (or None). eps [groups,N,latent]; None: z = mean."""
        out: dict[str, Any] = {"mean": [], "log_var": [], "decoded": [], "input": [x[:, :, group] for group in self.groups]}
        latents: list[torch.Tensor] = []
        for i, (mean, log_var) in enumerate(self.distributions(x)):
            latents.append(mean if eps is None else mean + torch.exp(log_var / 2) * eps[i])
            for key, value in (("mean", mean), ("log_var", log_var), ("decoded", self.decode(latents[i], i))):
                out[key].append(value)
        picture, error = self.upsample(torch.cat(latents, 1) if latents else None, x)
        return out | {"picture": picture, "predicted_error": error}


def ssim(x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
    """Mean SSIM of pictures [N,H,W] after Wang 2004: Gaussian of 11x11 and sigma 1.5; on smaller ones uniform, of the
    largest odd size up to 7 that fits; data range 1, places where the window fits."""
    if min(x.shape[1:]) < 11:
        size = min(7, (min(x.shape[1:]) - 1) // 2 * 2 + 1)
        window = torch.full((size, size), 1 / size**2, dtype=x.dtype)
    else:
        g = torch.exp(-(torch.arange(11, dtype=x.dtype) - 5) ** 2 / (2 * 1.5**2))
        window = torch.outer(g, g) / g.sum() ** 2

    def blur(image: torch.Tensor) -> torch.Tensor:
        return F.conv2d(image[:, None], window[None, None])[:, 0]

    mx, my = blur(x), blur(y)
    vx, vy, cov = blur(x * x) - mx**2, blur(y * y) - my**2, blur(x * y) - mx * my
    c1, c2 = 0.01**2, 0.03**2
    return ((2 * mx * my + c1) * (2 * cov + c2) / ((mx**2 + my**2 + c1) * (vx + vy + c2))).mean()


def kl_divergence(mean: torch.Tensor, log_var: torch.Tensor) -> torch.Tensor:
    return -0.5 * (1 + log_var - mean**2 - log_var.exp()).sum(1).mean()


def loss_terms(out: dict[str, Any], truth: torch.Tensor, a: float = 0.2, beta: float = 1e-3,
               weight_ssim: float = 0.1) -> dict[str, Any]:
    """Of training_outputs(): docs/network.md has the formula. Without VAEs the picture's part is all."""
    flat = (truth.amax((-2, -1), keepdim=True) - truth.amin((-2, -1), keepdim=True)) < 0.01
    structure = ssim(torch.where(flat, truth, out["picture"]), truth)  # a flat truth has none to compare
    terms = {"reconstruction": sum(F.mse_loss(d, x) for d, x in zip(out["decoded"], out["input"])),
             "kld": sum(kl_divergence(m, v) for m, v in zip(out["mean"], out["log_var"])),
             "l2": F.mse_loss(out["picture"], truth), "ssim": structure}
    picture = terms["l2"] + weight_ssim * (1 - terms["ssim"])
    if out["predicted_error"] is not None:  # it learns the error; the picture does not learn to be predictably wrong
        terms["predicted_error"] = F.mse_loss(out["predicted_error"], (out["picture"] - truth).abs().detach())
        picture = picture + 0.1 * terms["predicted_error"]
    if not out["decoded"]:
        return terms | {"total": picture}
    return terms | {"total": a * (terms["reconstruction"] + beta * terms["kld"]) + (1 - a) * picture}
