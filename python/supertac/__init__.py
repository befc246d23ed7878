"""Reads what SuperTac writes - recordings, models, logs of pictures - and draws pictures with NumPy alone.

    import supertac
    model = supertac.load("model.safetensors")
    recording = supertac.load("recordings/6_Ridges_t1_p1_v10.safetensors")
    times, volts = model.windows(recording)
    pictures = model(volts)                     # [N, height, width]
"""
from __future__ import annotations

import os

from .files import read, write
from .library import VERSION as __version__
from .library import LiveWindow, SurfaceMap, train
from .model import Model, Pictures, load_model, save_model
from .recordings import Log, Recording, read_pictures, read_recording, windows, write_recording

__all__ = ["__version__", "LiveWindow", "Log", "Model", "Pictures", "Recording", "SurfaceMap", "load", "load_model",
           "read", "read_pictures", "read_recording", "save_model", "train", "windows", "write", "write_recording"]


def load(path: str | os.PathLike) -> Model | Recording | Log:
    """What a file of our programs holds: a model, a recording, or pictures of supertac-stream --out. Raises ValueError
    naming the file and what is wrong."""
    kind = read(path)[1].get("kind", "")
    return {"recording": read_recording, "pictures": read_pictures}.get(kind, load_model)(path)
