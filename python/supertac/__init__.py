"""Reads what SuperTac writes - recordings, models, logs of pictures - and draws pictures with NumPy alone.

    import supertac
    model = supertac.load("model.safetensors")
    recording = supertac.load("recordings/6_Ridges_t1_p1_v10.safetensors")
    times, volts = model.windows(recording)
    pictures = model(volts)                     # [N, height, width]
"""
from __future__ import annotations

from .files import Path, read, write
from .library import VERSION as __version__
from .library import LiveWindow, SurfaceMap, train
from .model import Model, Pictures, load_model, save_model
from .recordings import Log, Recording, read_pictures, read_recording, windows, write_recording
from .sensor import Frame, Frames, Probe, Sensor

__all__ = ["__version__", "Frame", "Frames", "LiveWindow", "Log", "Model", "Pictures", "Probe", "Recording",
           "Sensor", "SurfaceMap", "load", "load_model", "read", "read_pictures", "read_recording", "save_model",
           "train", "windows", "write", "write_recording"]


def load(path: Path) -> Model | Recording | Log | Sensor:
    """What a file of our programs holds: a model, a recording, pictures of supertac-stream --out, or a sensor (.json).
    Raises ValueError naming the file and what is wrong."""
    if str(path).endswith(".json"):
        return Sensor(path)
    kind = read(path)[1].get("kind", "")
    if kind == "recording":
        return read_recording(path)
    return read_pictures(path) if kind == "pictures" else load_model(path)
