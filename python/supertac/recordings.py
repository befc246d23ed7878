"""Recordings of the finger, logs of pictures, and the windows that a network looks at."""
from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from .files import Array, Path, expect, parse_json, read, write

RIG = {"rows": 4, "columns": 4, "pitch_mm": 3, "channels": 1}
RIG_SIGNALS = {"unit": "V", "pressed": "lower"}  # of a recording that does not say
SLACK = 1e-6  # of a period: time stamps are rounded


@dataclasses.dataclass
class Recording:
    """One pass of the finger; n frames of S signals."""

    time_s: Array  # [n], increasing
    volts: Array  # [n,S], in the sensor's unit
    position_mm: Array | None = None  # [n,2], x and y of the finger's centre; NaN where unknown
    array: dict[str, Any] = dataclasses.field(default_factory=lambda: dict(RIG))  # taxel k: row k // columns, column k % columns
    metadata: dict[str, str] = dataclasses.field(default_factory=dict)  # plate, trial, pass, signals, ...
    lift_mm: Array | None = None  # [n], of the finger above its slide
    truth: Array | None = None  # [n,H,W] in 0 to 1, what a finer sensor saw

    @property
    def signals(self) -> dict[str, Any]:
        """Unit, polarity and range of the sensor."""
        return RIG_SIGNALS | (json.loads(self.metadata["signals"]) if "signals" in self.metadata else {})

    def __repr__(self) -> str:
        array = self.array
        return (f"Recording({len(self.time_s)} frames [{self.volts.shape[1]}] of {array['rows']}x{array['columns']} taxels, "
                f"{array['channels']} each, in {self.signals['unit']}"
                + (f", {self.metadata['plate']}" if "plate" in self.metadata else "") + ")")

    @property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 0


@dataclasses.dataclass
class Log:
    """What supertac-stream --out wrote: n pictures with the frames they were drawn at."""

    time_s: Array  # [n]
    volts: Array  # [n,S]
    pictures: Array  # [n,height,width]
    half_widths: Array | None  # the same: of the pixels' 90 % intervals
    distances: Array | None  # [n], from what the model was trained on
    metadata: dict[str, str]

    def __repr__(self) -> str:
        unit = json.loads(self.metadata.get("signals", json.dumps(RIG_SIGNALS)))["unit"]
        return f"Log({len(self.pictures)} pictures {list(self.pictures.shape[1:])} of {self.volts.shape[1]} signals in {unit})"


SHAPES: dict[str, list[Any]] = {"time_s": ["n"], "volts": ["n", None], "position_mm?": ["n", 2], "lift_mm?": ["n"],
                           "truth?": ["n", None, None]}


def _named(tensors: dict[str, Array]) -> dict[str, Array]:
    """The signals of a sensor that does not give volts are the tensor `signals`."""
    return {"volts" if name == "signals" else name: values for name, values in tensors.items()}


def _check(path: Path, recording: Recording) -> None:
    array, times, volts = recording.array, recording.time_s, recording.volts
    pitch = array.get("pitch_mm") if isinstance(array, dict) else None  # or [along a row, from row to row]
    numbers = [*pitch] if isinstance(pitch, list) and len(pitch) == 2 else [pitch]
    if not isinstance(array, dict) or not all(
            isinstance(n, (int, float)) for n in numbers + [array.get(key) for key in ("rows", "columns", "channels")]):
        raise ValueError(f"{path}: its array is {array}, expected such as {RIG}")
    if volts.shape[1] != array["rows"] * array["columns"] * array["channels"]:
        raise ValueError(f"{path}: has {volts.shape[1]} signals, its array {array} has others")
    if not (np.diff(times) > 0).all():
        raise ValueError(f"{path}: its times do not increase; record or import it again")


def contradiction(volts: Array, stated: dict[str, Any]) -> str:
    """Why these cannot be signals of a sensor that is stated so, as data/recordings/resample.h; "" where they can."""
    if "range" not in stated or not volts.size:
        return ""
    (low, high), least, most = stated["range"], float(volts.min()), float(volts.max())
    margin = 0.25 * (high - low)
    outside = ((volts < low - margin) | (volts > high + margin)).mean()
    shares = (least >= -0.01 and most <= 1.01 and most - least > 0.5 and high - low >= 10
              and (volts != np.round(volts)).any())
    if outside <= 0.5 and not shares:
        return ""
    return f"from {least:g} to {most:g}, the sensor's range is {low:g} to {high:g} {stated['unit']}"


def read_recording(path: Path) -> Recording:
    """A recording of any of our programs. Raises ValueError naming the file and what is wrong."""
    tensors, metadata = read(path)
    if metadata.get("kind") != "recording":
        raise ValueError(f"{path}: expected a recording, found a {metadata.get('kind', 'file of another kind')}")
    array = parse_json(path, metadata["array"]) if "array" in metadata else dict(RIG)
    times, volts, position, lift, truth = expect(path, _named(tensors), SHAPES)
    recording = Recording(times, volts, position, array, metadata, lift, truth)
    _check(path, recording)
    return recording


def write_recording(path: Path, recording: Recording) -> None:
    """A file that our programs train on. Of the metadata, plate ("unknown"), trial and pass (1), speed_mm_s (0) and
    source ("python") have defaults; "signals" states unit, polarity and range of another sensor than the rig, as in
    {"unit": "counts", "pressed": "higher", "range": [40, 900]} (JSON). Raises ValueError for what they would refuse."""
    tensors: dict[str, Any] = {"time_s": np.asarray(recording.time_s, "<f8")}
    tensors |= {name: np.asarray(value, "<f4") for name in ("volts", "position_mm", "lift_mm", "truth")
                if (value := getattr(recording, name)) is not None}
    expect(path, tensors, SHAPES)
    for name, values in tensors.items():
        bad = np.isinf(values) if name == "position_mm" else ~np.isfinite(values)
        if bad.any():
            raise ValueError(f"{path}: {name} of frame {np.argwhere(bad)[0][0]} is not finite; leave the frame out")
    if "truth" in tensors and not ((tensors["truth"] >= 0) & (tensors["truth"] <= 1)).all():
        raise ValueError(f"{path}: truth must lie in 0 to 1; scale it")
    _check(path, dataclasses.replace(recording, **tensors))
    if why := contradiction(tensors["volts"], recording.signals):
        raise ValueError(f"{path}: its signals run {why}; save them in the sensor's unit, or state their range")
    fields = {"plate": "unknown", "trial": "1", "pass": "1", "speed_mm_s": "0", "source": "python"} | recording.metadata
    fields = {key: str(value) for key, value in fields.items() if key not in ("checksum", "supertac_format")}
    if recording.array != RIG:
        fields["array"] = json.dumps(recording.array)
    write(path, tensors, fields | {"kind": "recording"}, checksum=True)


def read_pictures(path: Path) -> Log:
    """What supertac-stream --out wrote. Raises ValueError naming the file and what is wrong."""
    tensors, metadata = read(path)
    if "pictures" not in tensors:
        raise ValueError(f"{path}: expected the pictures of supertac-stream --out, found {sorted(tensors)}")
    picture = ["n", "height", "width"]
    times, volts, pictures, half_widths, distances = expect(
        path, _named(tensors), {"time_s": ["n"], "volts": ["n", None], "pictures": picture, "half_widths?": picture,
                        "distances?": ["n"]})
    return Log(times, volts, pictures, half_widths, distances, metadata)


def _runs(times: Array, max_gap_s: float) -> Iterable[tuple[int, int]]:
    """Pairs (begin, end) of frames between which no silence is longer."""
    cuts = np.flatnonzero(np.diff(times) > max_gap_s) + 1
    return zip([0, *cuts], [*cuts, len(times)])


def _means(values: Array, first: Array) -> Array:
    """Of each frame the mean of those from the first-th to it."""
    means: Array = np.stack([values[a : i + 1].sum(axis=0, dtype=np.float64) / (i + 1 - a) for i, a in enumerate(first)])
    return means.astype(np.float32)


def windows(recording: Recording, timesteps: int, rate_hz: float,
            max_gap_s: float = 0.05, filter_s: float = 0) -> tuple[Array, Array]:
    """Times [N] and windows [N,timesteps,S] in volts, one for each frame that has a whole window behind it: what
    supertac-stream draws. Sample j of a run without a gap is the mean of the frames around the run's first time plus
    j / rate_hz, as far as they have come; one without frames repeats the one before (data/recordings/resample.h).
    filter_s: a moving average that comes first (data/windows/live_window.h)."""
    finite = np.isfinite(recording.volts).all(axis=1) & np.isfinite(recording.time_s)
    times, volts = recording.time_s[finite], recording.volts[finite]
    period_s = recording.period_s
    max_gap_s = max(max_gap_s, 3 * period_s)  # a silence within so many periods of a slow sensor is none
    out_times, out = [np.empty(0)], [np.empty((0, timesteps, volts.shape[1]), np.float32)]
    for begin, end in _runs(times, max_gap_s) if len(times) else ():
        run, values = times[begin:end], volts[begin:end]
        if filter_s > 0:
            values = _means(values, np.searchsorted(run, run - max(0, filter_s - 0.5 * period_s)))
        if timesteps == 1:
            out_times.append(run)
            out.append(values[:, None])
            continue
        cell = np.maximum(0, np.ceil((run - run[0]) * rate_hz - 0.5 - SLACK)).astype(int)  # whose sample a frame is of
        first = np.searchsorted(cell, cell)  # the first frame of a frame's sample
        so_far = _means(values, first)
        last = np.searchsorted(cell, np.arange(cell[-1] + 1), side="right") - 1  # the frame that completes a sample
        ends = np.flatnonzero(cell >= timesteps - 1)
        chosen = last[cell[ends, None] + np.arange(1 - timesteps, 1)]
        chosen[:, -1] = ends
        out_times.append(run[ends])
        out.append(so_far[chosen])
    return np.concatenate(out_times), np.concatenate(out)
