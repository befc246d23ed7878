"""A model file and its forward pass in NumPy (docs/network.md has the layers)."""
from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from . import library, recordings
from .files import Array, Path, read, write


class Pictures(NamedTuple):
    """[N,height,width] each, predicted_error is None for a model without; latents [N,groups x latent]. Of NumPy or of
    PyTorch."""
    picture: Any
    predicted_error: Any
    latents: Any


# Of normalised windows (data/windows/transforms.h).
BINS, LEAST_GAIN, REST_REMOVED, REST_SHARE, TOP_RANK = 256, np.float32(0.15), np.float32(0.5), 20, 3

OWN = ("encoder.", "decoder.", "upsampler.")  # tensors of the network; others belong to what stands beside it


def leaky_relu(x: Any) -> Any:
    return np.where(x > 0, x, np.float32(0.01) * x)


def relu(x: Any) -> Any:
    return np.maximum(x, 0)


def sigmoid(x: Any) -> Any:
    return 1 / (1 + np.exp(-x))


def convolve(x: Any, weight: Any, bias: Any, stride: int = 1, padding: int = 1) -> Any:
    """x [N,C,P...], weight [out,C,k...] -> [N,out,P'...]"""
    axes = tuple(range(2, x.ndim))
    x = np.pad(x, [(0, 0), (0, 0)] + [(padding, padding)] * len(axes))
    patches = np.lib.stride_tricks.sliding_window_view(x, weight.shape[2:], axes)
    patches = patches[(slice(None), slice(None)) + (slice(None, None, stride),) * len(axes)]
    summed = [1, *range(x.ndim, patches.ndim)]
    y = np.tensordot(patches, weight, axes=(summed, range(1, weight.ndim)))
    return np.moveaxis(y + bias, -1, 1)


def convolve_transposed(x: Any, weight: Any, bias: Any, stride: int = 2, padding: int = 1) -> Any:
    """x [N,C,P...], weight [C,out,k...]: zeros between the pixels, then a convolution with the mirrored kernel."""
    axes = tuple(range(2, x.ndim))
    wide = np.zeros(x.shape[:2] + tuple((n - 1) * stride + 1 for n in x.shape[2:]), x.dtype)
    wide[(slice(None), slice(None)) + (slice(None, None, stride),) * len(axes)] = x
    return convolve(wide, np.flip(weight.swapaxes(0, 1), axes), bias, 1, weight.shape[2] - 1 - padding)


def level(windows: Any) -> Any:
    """Windows [N,T,S] in [0,1], each brought to its own rest and gain."""
    timesteps = windows.shape[1]
    ordered = np.sort(windows, axis=1)

    def bin_of(sample: Any) -> Any:
        return np.floor(np.minimum(sample * np.float32(BINS), BINS - 1)) / np.float32(BINS)

    removed = REST_REMOVED * bin_of(ordered[:, timesteps // REST_SHARE])
    swing = bin_of(ordered[:, timesteps - TOP_RANK]) - removed
    gain = np.maximum(swing.max(axis=1), LEAST_GAIN)[:, None, None]
    return np.clip((windows - removed[:, None]) * (np.float32(1) / gain), 0, 1)


def groups_of(settings: dict[str, Any]) -> list[Array]:
    """The signals of each VAE: a row of the array, or a column; single frames have none."""
    if settings["timesteps"] == 1:
        return []
    rows, columns, channels = (settings.get(name, value) for name, value in
                               (("rows", 4), ("columns", 4), ("in_channels", 1)))
    signals = np.arange(rows * columns * channels).reshape(rows, columns, channels)
    along = signals if settings["grouping"] == "horizontal" else signals.swapaxes(0, 1)
    return [group.reshape(-1) for group in along]


class Model:
    """The tensors and settings of a model file."""

    def __init__(self, tensors: dict[str, Array], metadata: dict[str, str], path: Path):
        self.tensors, self.metadata, self.path = tensors, metadata, path
        self._drawers: dict[tuple[str, int], library.Drawer] = {}
        self.settings, self.input = json.loads(metadata["settings"]), json.loads(metadata["input"])
        self.groups = groups_of(self.settings)
        self.map = tuple(self.settings.get(name, 4) for name in ("rows", "columns"))
        self.window = self.settings["timesteps"], self.map[0] * self.map[1] * self.settings.get("in_channels", 1)

    def __repr__(self) -> str:
        rows, columns = self.map
        return (f"Model({rows}x{columns} taxels, {self.settings.get('in_channels', 1)} each, in {self._sensor()['unit']}; "
                f"windows [{self.window[0]},{self.window[1]}] at {self.input['rate_hz']:g} Hz -> pictures "
                f"[{rows * self.settings['scale']},{columns * self.settings['scale']}])")

    def __call__(self, volts: Array) -> Array:
        """predict()"""
        return self.predict(volts)

    def predict(self, volts: Array) -> Array:
        """Pictures [N,height,width] of windows [N,T,S], or one [height,width] of [T,S], in the sensor's unit."""
        values = np.asarray(volts)
        pictures: Array = self.draw(values[None] if values.ndim == 2 else values).picture
        return pictures[0] if values.ndim == 2 else pictures

    def _sensor(self) -> dict[str, Any]:
        return {**recordings.RIG_SIGNALS, **self.input.get("signals", {})}

    def _check(self, recording: recordings.Recording) -> None:
        """Raises ValueError for a recording of another sensor, as the programs do."""
        ours = (*self.map, self.settings.get("in_channels", 1))
        theirs = tuple(recording.array[key] for key in ("rows", "columns", "channels"))
        if theirs != ours:
            raise ValueError(f"the recording is of {theirs[0]}x{theirs[1]} taxels with {theirs[2]} channels, the model was"
                             f" trained on {ours[0]}x{ours[1]} with {ours[2]}; choose recordings and model of one array")
        found, expected = recording.signals, self._sensor()
        for key in ("unit", "pressed"):
            if found[key] != expected[key]:
                raise ValueError(f"the recording's signals have {key} {found[key]!r}, the model's {expected[key]!r}; "
                                 "choose recordings and model of one sensor")
        if why := recordings.contradiction(recording.volts, found):
            raise ValueError(f"the recording's signals run {why}; import it anew with the file of its sensor")

    def windows(self, recording: recordings.Recording) -> tuple[Array, Array]:
        """Times and windows in the sensor's unit, filtered as the training was, of a recording. Raises ValueError for one of
        another array, unit or polarity than the model's, and for one that another filter has gone over."""
        self._check(recording)
        done, wanted = float(recording.metadata.get("filter_s", 0)), self.input.get("filter_s")
        same = wanted is None or abs(wanted - done) < 1e-4
        if done > 0 and not same:
            raise ValueError(f"the recording's signals have gone through a moving average of {done:g} s, the model was trained "
                             f"behind one of {wanted:g} s; choose recordings and model of one kind")
        return recordings.windows(recording, self.settings["timesteps"], self.input["rate_hz"], filter_s=0 if same else wanted)

    def pairs(self, folder: Path, stride: int = 1) -> tuple[Array, Array]:
        """What the model could be trained on of a folder of recordings, slides as presses: windows [N,T,S] as the network
        takes them, for draw() and training_outputs() of to_torch(), and truths [N,height,width]. Every stride-th frame of a
        recording ends one. Raises ValueError where there is none, or without the C library (library.py)."""
        return library.pairs(self.drawer(), folder, stride)

    def scale(self, volts: Array) -> Array:
        """Volts [N,T,S] -> what the network takes."""
        share = (self.input["rest_volts"] - volts.astype(np.float64)) / self.input["span_volts"]
        x = np.clip(share, 0, 1).astype(np.float32)
        scaled: Array = level(x) if self.input.get("levelled") else x
        return scaled

    def drawer(self, precision: str = "fp32", threads: int = 1) -> library.Drawer:
        """The same network in the C library (library.py). Raises ValueError where it is not installed."""
        if (precision, threads) not in self._drawers:
            self._drawers[precision, threads] = library.Drawer(self.path, self.settings, precision, threads)
        return self._drawers[precision, threads]

    def draw(self, volts: Array, batch: int = 64, precision: str | None = None, threads: int = 1) -> Pictures:
        """Pictures of windows [N,T,S] in volts. With a precision, "fp32" or "int8", the C library draws them, to the
        bits of the programs and without latents; otherwise NumPy does."""
        if precision is not None:
            return Pictures(*self.drawer(precision, threads).draw(volts), None)
        volts = library.checked_windows(volts, self.window)
        if np.isnan(volts).any():
            raise ValueError("windows hold NaN; leave these out")
        parts = [self._draw(self.scale(volts[i : i + batch])) for i in range(0, max(len(volts), 1), batch)]
        return Pictures(*(None if part[0] is None else np.concatenate(part) for part in zip(*parts)))

    def to_torch(self) -> Any:
        """A torch.nn.Module with the same parameters and names; its forward() takes volts and returns Pictures."""
        import torch

        from .torch_model import SuperTac

        module = SuperTac(self.settings, self.input, self.groups)
        module.load_state_dict({name: torch.tensor(t) for name, t in self.tensors.items() if name.startswith(OWN)})
        return module

    def _of(self, name: str) -> tuple[Array, Array]:
        return self.tensors[name + ".weight"], self.tensors[name + ".bias"]

    def _linear(self, x: Any, name: str) -> Any:
        weight, bias = self._of(name)
        return x @ weight.reshape(weight.shape[:2]).T + bias

    def _convolve(self, x: Any, name: str, **settings: int) -> Any:
        return convolve(x, *self._of(name), **settings)

    def _parts(self, pattern: str) -> Iterator[str]:
        """Names that the pattern makes of 0, 1, ... as long as there is such a layer."""
        count = 0
        while any(name.startswith(pattern.format(count) + ".") for name in self.tensors):
            yield pattern.format(count)
            count += 1

    def _encode(self, x: Any, name: str) -> Any:
        for conv in self._parts(name + ".conv.{}"):
            x = leaky_relu(self._convolve(x, conv, stride=2))
        return self._linear(relu(self._linear(x.reshape(len(x), x.shape[1] * x.shape[2]), name + ".fc")), name + ".mean")

    def _rcab(self, x: Any, name: str) -> Any:
        h = self._convolve(relu(self._convolve(x, name + ".conv.0")), name + ".conv.1")
        squeezed = relu(self._linear(h.mean(axis=(2, 3)), name + ".attention.squeeze"))
        return x + h * sigmoid(self._linear(squeezed, name + ".attention.expand"))[:, :, None, None]

    def _rirb(self, x: Any, name: str) -> Any:
        h = x
        for block in self._parts(name + ".rcab.{}"):
            h = self._rcab(h, block)
        return leaky_relu(convolve_transposed(x + self._convolve(h, name + ".conv"), *self._of(name + ".up")))

    def _draw(self, x: Any) -> tuple[Any, Any, Any]:
        latents: Any = None
        h: Any = 0
        if self.groups:
            latents = np.concatenate([self._encode(x[:, :, group].swapaxes(1, 2), f"encoder.{i}")
                                      for i, group in enumerate(self.groups)], axis=1)
            h = leaky_relu(self._linear(latents, "upsampler.fc"))
            h = h.reshape(len(x), h.shape[1] // (self.map[0] * self.map[1]), *self.map)
        if self.settings.get("last_frame_path") or not self.groups:
            frame = np.moveaxis(x[:, -1].reshape(len(x), *self.map, self.settings.get("in_channels", 1)), -1, 1)
            h = h + leaky_relu(self._convolve(frame, "upsampler.last_frame"))
        for name in self._parts("upsampler.rirb.{}"):
            h = self._rirb(h, name)
        error = self._convolve(h, "upsampler.spread")[:, 0] if self.settings.get("spread") else None
        return self._convolve(h, "upsampler.out")[:, 0], error, latents


def load_model(path: Path) -> Model:
    """A model that supertac-train wrote. Raises ValueError naming the file and what is wrong."""
    tensors, metadata = read(path)
    if metadata.get("format") != "supertac-checkpoint" or "kind" in metadata:
        raise ValueError(f"{path}: expected a model that supertac-train wrote, found "
                         + metadata.get("kind", metadata.get("format", "another file")))
    try:
        return Model(tensors, metadata, path)
    except (AttributeError, KeyError, TypeError) as problem:
        raise ValueError(f"{path}: its settings are not those of a model: {problem!r}") from None


def save_model(path: Path, module: Any, parent: Model) -> None:
    """Writes a module of to_torch(), trained further, as a model file. `parent`: the Model that it came from, whose
    settings it has, and which the provenance names by its content. Ranges for int8 and the alarm for signals unlike
    training are left out: they were those of other weights."""
    tensors = {name: np.ascontiguousarray(value.detach().cpu().numpy().astype(np.float32))
               for name, value in module.state_dict().items()}
    missing = {name for name in parent.tensors if name.startswith(OWN)} ^ set(tensors)
    if missing:
        raise ValueError(f"{path}: expected the tensors of the model that it came from, {sorted(missing)[0]} differs")
    digest = hashlib.sha256(b"".join(t.tobytes() for t in parent.tensors.values())).hexdigest()
    provenance = {"command": "supertac.save_model", "version": library.VERSION, "parents": {"model": digest}}
    metadata = {key: value for key, value in parent.metadata.items() if key not in ("checksum", "supertac_format")}
    write(path, tensors, metadata | {"provenance": json.dumps(provenance, separators=(",", ":"))}, checksum=True)
