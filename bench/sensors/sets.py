"""Public sets of other sensors, as recordings: a finer array is the truth, its frames pooled are what an array of fewer
taxels would have felt. Nothing of the sets is here; `README.md` says where they are published and how they are laid out.
"""
import dataclasses
import json
import pathlib
from collections.abc import Iterator

import numpy as np

import supertac
from baselines import pooled


@dataclasses.dataclass
class Pass:
    group: str
    frames: np.ndarray  # [n,H,W] in 0 to 1
    rate_hz: float  # nominal: of time stamps some come late by less than a frame


def press(folder: pathlib.Path) -> Iterator[Pass]:
    with np.load(folder / "press_16x16.npz") as file:
        for frames, name in zip(file["frames"], file["object"]):
            yield from (Pass(str(name), trial / np.float32(255), 55) for trial in frames)


def mat(folder: pathlib.Path) -> Iterator[Pass]:
    with np.load(folder / "mat_64x32.npz") as file:
        for person in np.unique(file["person"]):
            for posture in np.unique(file["posture"]):
                chosen = (file["person"] == person) & (file["posture"] == posture)
                if chosen.any():
                    yield Pass(str(person), file["frames"][chosen] / np.float32(255), 1)


def _slides(folder: pathlib.Path, group) -> Iterator[Pass]:
    with np.load(folder / "slide_12x32.npz") as file:
        sessions, names, frames = (file[key] for key in ("session", "name", "frames"))
    for session in np.unique(sessions):
        chosen = sessions == session
        name = str(names[chosen][0]).lower()
        cover = next(cover for cover in ("ramp", "ellipsoid", "foam") if cover in name)
        yield Pass(group(cover, session), frames[chosen] / np.float32(255), 100)


def covers(folder: pathlib.Path) -> Iterator[Pass]:
    return _slides(folder, lambda cover, session: cover)


def sessions(folder: pathlib.Path) -> Iterator[Pass]:
    return _slides(folder, lambda cover, session: f"{session:02d}")


def soles(folder: pathlib.Path) -> Iterator[Pass]:
    """Six steps of each person, at an eighth of 500 Hz; 1 is 320 kPa, which one value in 10,000 exceeds. Of 63x33 sensors
    the last column is left out and a row without pressure is added, so that fours fit."""
    import h5py
    for path in sorted((folder / "SpeedPP2DS" / "data_y").glob("*.h5")):
        with h5py.File(path) as file:
            for name in sorted(file)[::10]:
                step = np.moveaxis(np.asarray(file[name], np.float32), 2, 0)[::8, :, :32] / 320
                last = np.flatnonzero(step.any(axis=(1, 2)))[-1]
                frames = np.zeros((last + 1, 64, 32), np.float32)
                frames[:, :step.shape[1]] = step[: last + 1].clip(0, 1)
                yield Pass(path.stem, frames, 62.5)


# name: how it is read, scale, and whether frames belong together in time
SETS = {"press": (press, 4, True), "soles": (soles, 4, True), "soles_x2": (soles, 2, False), "mat": (mat, 4, False),
        "covers": (covers, 2, True), "sessions": (sessions, 2, True)}


def write(passes: list[Pass], scale: int, window: int, folder: pathlib.Path) -> None:
    """Recordings of these passes; metadata `group` names the person, object or session. The first frame is repeated, so
    that every frame ends a window of so many."""
    folder.mkdir(parents=True)
    for number, one in enumerate(passes, 1):
        truth = np.concatenate([np.repeat(one.frames[:1], window - 1, axis=0), one.frames])
        taxels = pooled(truth, scale)
        array = {"rows": taxels.shape[1], "columns": taxels.shape[2], "pitch_mm": 1, "channels": 1}
        signals = json.dumps({"unit": "share of the largest", "pressed": "higher", "range": [0, 1]})
        metadata = {"plate": "measured", "group": one.group, "pass": str(number), "signals": signals}
        supertac.write_recording(folder / f"{number:04d}.safetensors", supertac.Recording(
            time_s=np.arange(len(truth)) / one.rate_hz, volts=taxels.reshape(len(taxels), -1), array=array,
            metadata=metadata, truth=truth))
