"""Reads what SuperTac writes - recordings, models, logs of pictures - and draws pictures with NumPy alone.

    import supertac
    model = supertac.load_model("model.safetensors")
    recording = supertac.read_recording("recordings/6_Ridges_t1_p1_v10.safetensors")
    times, volts = model.windows(recording)
    pictures = model.draw(volts).picture        # [N, height, width]
"""
from .files import read, write
from .library import LiveWindow, train
from .model import Model, Pictures, load_model, save_model
from .recordings import Log, Recording, read_pictures, read_recording, windows, write_recording

__all__ = ["LiveWindow", "Log", "Model", "Pictures", "Recording", "load_model", "read", "read_pictures", "read_recording",
           "save_model", "train", "windows", "write", "write_recording"]
