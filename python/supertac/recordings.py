"""Recordings of the finger, logs of pictures, and the windows that a network looks at."""
import dataclasses

import numpy as np

from .files import expect, parse_json, read

RIG = {"rows": 4, "columns": 4, "pitch_mm": 3, "channels": 1}
SLACK = 1e-6  # of a period: time stamps are rounded


@dataclasses.dataclass
class Recording:
    """One pass of the finger; n frames of S signals."""

    time_s: np.ndarray  # [n], increasing
    volts: np.ndarray  # [n,S]; pressure lowers them
    position_mm: np.ndarray | None  # [n,2], x and y of the finger's centre; NaN where unknown
    array: dict  # rows, columns, pitch_mm, channels; taxel k lies in row k // columns, column k % columns
    metadata: dict  # plate, trial, pass, ..., as text

    @property
    def period_s(self):
        return float(np.median(np.diff(self.time_s)))


@dataclasses.dataclass
class Log:
    """What supertac-stream --out wrote: n pictures with the frames they were drawn at."""

    time_s: np.ndarray  # [n]
    volts: np.ndarray  # [n,S]
    pictures: np.ndarray  # [n,height,width]
    half_widths: np.ndarray | None  # the same: of the pixels' 90 % intervals
    distances: np.ndarray | None  # [n], from what the model was trained on
    metadata: dict


def read_recording(path):
    tensors, metadata = read(path)
    if metadata.get("kind") != "recording":
        raise ValueError(f"{path}: expected a recording, found a {metadata.get('kind', 'file of another kind')}")
    array = parse_json(path, metadata["array"]) if "array" in metadata else dict(RIG)
    if not isinstance(array, dict) or not all(isinstance(array.get(key), (int, float)) for key in RIG):
        raise ValueError(f"{path}: its array is {array}, expected such as {RIG}")
    times, volts, position = expect(path, tensors, {"time_s": ["n"], "volts": ["n", None], "position_mm?": ["n", None]})
    if volts.shape[1] != array["rows"] * array["columns"] * array["channels"]:
        raise ValueError(f"{path}: has {volts.shape[1]} signals, its array {array} has others")
    if not (np.diff(times) > 0).all():
        raise ValueError(f"{path}: its times do not increase; record or import it again")
    return Recording(times, volts, position, array, metadata)


def read_pictures(path):
    tensors, metadata = read(path)
    if "pictures" not in tensors:
        raise ValueError(f"{path}: expected the pictures of supertac-stream --out, found {sorted(tensors)}")
    picture = ["n", "height", "width"]
    return Log(*expect(path, tensors, {"time_s": ["n"], "volts": ["n", None], "pictures": picture,
                                       "half_widths?": picture, "distances?": ["n"]}), metadata)


def _runs(times, max_gap_s):
    """Pairs (begin, end) of frames between which no silence is longer."""
    cuts = np.flatnonzero(np.diff(times) > max_gap_s) + 1
    return zip([0, *cuts], [*cuts, len(times)])


def _window(times, volts, end_s, timesteps, rate_hz):
    """The samples that end at end_s: means of the frames of each period; one without frames repeats the one before."""
    age = np.floor((end_s - times) * rate_hz + SLACK).astype(int)  # of frames, in samples; falls with time
    first = np.flatnonzero(np.r_[True, np.diff(age) != 0])
    counts = np.diff(np.r_[first, len(age)])
    means = (np.add.reduceat(volts, first, axis=0, dtype=np.float64) / counts[:, None]).astype(np.float32)
    wanted = np.arange(timesteps - 1, -1, -1)
    last_not_younger = np.searchsorted(-age[first], -wanted, side="right") - 1
    return means[last_not_younger]


def windows(recording, timesteps, rate_hz, max_gap_s=0.05):
    """Times [N] and windows [N,timesteps,S] in volts, one for each frame that has a whole window behind it: what
    supertac-stream draws (data/windows/live_window.h)."""
    finite = np.isfinite(recording.volts).all(axis=1) & np.isfinite(recording.time_s)
    times, volts = recording.time_s[finite], recording.volts[finite]
    max_gap_s = max(max_gap_s, 3 * recording.period_s)  # a silence within so many periods of a slow sensor is none
    half_s = 0.5 * min(recording.period_s, 1 / rate_hz)
    reach_s = timesteps / rate_hz + max_gap_s + 2 / rate_hz
    out_times, out = [], []
    for begin, end in _runs(times, max_gap_s):
        for i in range(begin, end):
            end_s = times[i] + half_s
            if (end_s - times[begin]) * rate_hz < timesteps - 0.5 - SLACK:
                continue
            low = max(begin, np.searchsorted(times, end_s - reach_s))
            out.append(_window(times[low : i + 1], volts[low : i + 1], end_s, timesteps, rate_hz))
            out_times.append(times[i])
    shape = (0, timesteps, volts.shape[1])
    return np.array(out_times), np.stack(out) if out else np.empty(shape, np.float32)
