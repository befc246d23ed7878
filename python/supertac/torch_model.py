"""The network as a torch.nn.Module. Names and layouts are those of the model file, so load_state_dict() takes it."""
import torch
from torch import nn
from torch.nn import functional as F

from .model import BINS, LEAST_GAIN, REST_REMOVED, REST_SHARE, TOP_RANK, Pictures


def layers(**parts):
    return nn.ModuleDict(parts)


def encoder(signals, timesteps, latent):
    sizes = [signals, 16, 32, 32, 32]
    return layers(conv=nn.ModuleList(nn.Conv1d(a, b, 3, 2, 1) for a, b in zip(sizes, sizes[1:])),
                  fc=nn.Linear(2 * timesteps, 64), mean=nn.Linear(64, latent), log_var=nn.Linear(64, latent))


def decoder(signals, timesteps, latent):
    sizes = [32, 32, 32, 16, 16]
    return layers(fc=nn.ModuleList([nn.Linear(latent, 64), nn.Linear(64, 2 * timesteps)]),
                  conv=nn.ModuleList(nn.ConvTranspose1d(a, b, 4, 2, 1) for a, b in zip(sizes, sizes[1:])),
                  out=nn.Conv1d(16, signals, 3, padding=1))


def rcab(channels, squeezed):
    return layers(conv=nn.ModuleList(nn.Conv2d(channels, channels, 3, padding=1) for _ in range(2)),
                  attention=layers(squeeze=nn.Conv2d(channels, squeezed, 1), expand=nn.Conv2d(squeezed, channels, 1)))


def rirb(channels, squeezed, blocks):
    return layers(rcab=nn.ModuleList(rcab(channels, squeezed) for _ in range(blocks)),
                  conv=nn.Conv2d(channels, channels, 3, padding=1), up=nn.ConvTranspose2d(channels, channels, 4, 2, 1))


class SuperTac(nn.Module):
    def __init__(self, model):
        super().__init__()
        s, self.input, self.map = model.settings, model.input, model.map
        self.groups = [torch.tensor(group) for group in model.groups]
        vae = len(model.groups[0]), s["timesteps"], s["latent"]
        channels, count = s["channels"], len(self.groups)
        squeezed = max((t.shape[0] for name, t in model.tensors.items() if name.endswith("squeeze.bias")), default=1)
        self.encoder = nn.ModuleList(encoder(*vae) for _ in range(count))
        self.decoder = nn.ModuleList(decoder(*vae) for _ in range(count))
        self.upsampler = layers(fc=nn.Linear(count * s["latent"], channels * self.map[0] * self.map[1]),
                                rirb=nn.ModuleList(rirb(channels, squeezed, s["rcabs"])
                                                   for _ in range(s["scale"].bit_length() - 1)),
                                out=nn.Conv2d(channels, 1, 3, padding=1))
        if s.get("spread"):
            self.upsampler["spread"] = nn.Conv2d(channels, 1, 3, padding=1)
        own = ("encoder.", "decoder.", "upsampler.")
        self.load_state_dict({name: torch.tensor(t) for name, t in model.tensors.items() if name.startswith(own)})

    def scale(self, volts):
        """Volts [N,T,S] -> what the network takes."""
        share = (self.input["rest_volts"] - volts.double()) / self.input["span_volts"]
        x = share.clamp(0, 1).float()
        return self.level(x) if self.input.get("levelled") else x

    @staticmethod
    def level(x):
        def bin_of(sample):
            return (sample * BINS).clamp(max=BINS - 1).floor() / BINS

        ordered = x.sort(dim=1).values
        removed = float(REST_REMOVED) * bin_of(ordered[:, x.shape[1] // REST_SHARE])
        swing = bin_of(ordered[:, x.shape[1] - TOP_RANK]) - removed
        gain = swing.amax(1).clamp(min=float(LEAST_GAIN))[:, None, None]
        return ((x - removed[:, None]) * (1 / gain)).clamp(0, 1)

    def distributions(self, x):
        """Of each group's latents: mean and log variance [N,latent]."""
        for part, group in zip(self.encoder, self.groups):
            h = x[:, :, group].transpose(1, 2)
            for conv in part["conv"]:
                h = F.leaky_relu(conv(h), 0.01)
            h = F.relu(part["fc"](h.flatten(1)))
            yield part["mean"](h), part["log_var"](h).clamp(-10, 10)

    def decode(self, z, i):
        """Latents of group i -> its window [N,T,S of the group], as training asks it to."""
        part = self.decoder[i]
        h = F.relu(part["fc"][1](F.relu(part["fc"][0](z)))).reshape(len(z), 32, -1)
        for conv in part["conv"]:
            h = F.leaky_relu(conv(h), 0.01)
        return torch.sigmoid(part["out"](h)).transpose(1, 2)

    def upsample(self, latents):
        up = self.upsampler
        h = F.leaky_relu(up["fc"](latents), 0.01).reshape(len(latents), -1, *self.map)
        for part in up["rirb"]:
            skip = h
            for block in part["rcab"]:
                r = block["conv"][1](F.relu(block["conv"][0](h)))
                squeezed = F.relu(block["attention"]["squeeze"](r.mean((2, 3), keepdim=True)))
                h = h + r * torch.sigmoid(block["attention"]["expand"](squeezed))
            h = F.leaky_relu(part["up"](skip + part["conv"](h)), 0.01)
        return up["out"](h)[:, 0], up["spread"](h)[:, 0] if "spread" in up else None

    def forward(self, volts):
        latents = torch.cat([mean for mean, _ in self.distributions(self.scale(volts))], 1)
        return Pictures(*self.upsample(latents), latents)
