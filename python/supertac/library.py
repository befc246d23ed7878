"""Draws with the C library (library/supertac.h), at the speed of the programs.

It is looked for at the path in SUPERTAC_LIBRARY, then in this package, whose wheel holds it, then where the system keeps
its libraries.
"""
from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from .files import Array, Path

if TYPE_CHECKING:
    from .model import Model

VERSION = "0.2.0"  # of the package and of the library that it takes
PRECISIONS = {"fp32": 0, "int8": 1}
POINTER, SIZE = ctypes.c_void_p, ctypes.c_size_t
PROGRESS = ctypes.CFUNCTYPE(ctypes.c_int, POINTER, ctypes.c_longlong, ctypes.c_double)
SIGNATURES = {  # result, arguments
    "supertac_error": (ctypes.c_char_p, []),
    "supertac_open_memory": (POINTER, [ctypes.c_char_p, SIZE, ctypes.c_int]),
    "supertac_close": (None, [POINTER]),
    "supertac_draw": (ctypes.c_int, [POINTER, SIZE, POINTER, POINTER, POINTER, ctypes.c_int]),
    "supertac_live_new": (POINTER, [POINTER, ctypes.c_double, ctypes.c_double]),
    "supertac_live_free": (None, [POINTER]),
    "supertac_live_push": (ctypes.c_int, [POINTER, ctypes.c_double, POINTER]),
    "supertac_live_picture": (ctypes.c_int, [POINTER, POINTER, POINTER]),
    "supertac_map_new": (POINTER, [POINTER]),
    "supertac_map_free": (None, [POINTER]),
    "supertac_map_add": (ctypes.c_int, [POINTER, ctypes.c_double, ctypes.c_double, POINTER, POINTER]),
    "supertac_map_cells": (ctypes.c_int, [POINTER] * 6),
    "supertac_sensor_new": (POINTER, [ctypes.c_char_p]),
    "supertac_sensor_free": (None, [POINTER]),
    "supertac_sensor_describe": (ctypes.c_int, [POINTER, POINTER]),
    "supertac_sensor_probe": (ctypes.c_char_p, [POINTER, ctypes.c_char_p, ctypes.c_double]),
    "supertac_sensor_start": (ctypes.c_int, [POINTER, ctypes.c_char_p]),
    "supertac_sensor_next": (ctypes.c_int, [POINTER, ctypes.c_double, POINTER, POINTER]),
    "supertac_sensor_lost": (ctypes.c_int, [POINTER, POINTER, POINTER]),
    "supertac_pairs_open": (POINTER, [POINTER, ctypes.c_char_p, ctypes.c_longlong]),
    "supertac_pairs_close": (None, [POINTER]),
    "supertac_pairs_count": (SIZE, [POINTER]),
    "supertac_pairs_read": (ctypes.c_int, [POINTER, SIZE, SIZE, POINTER, POINTER]),
    "supertac_train": (ctypes.c_int, [ctypes.c_char_p] * 3 + [POINTER, PROGRESS, POINTER]),
}


class Settings(ctypes.Structure):
    """supertac_training"""
    _fields_ = [("size", SIZE), ("epochs", ctypes.c_longlong), ("stride", ctypes.c_longlong),
                ("seed", ctypes.c_ulonglong), ("split", ctypes.c_char_p)]


@functools.cache
def library() -> ctypes.CDLL:
    """The C library. Raises ValueError where it is not installed."""
    ours = pathlib.Path(__file__).with_name("libsupertac.so")
    path = os.environ.get("SUPERTAC_LIBRARY") or (ours if ours.exists() else ctypes.util.find_library("supertac"))
    if path is None:
        raise ValueError("the C library is not installed: pip install ./python compiles it; or set SUPERTAC_LIBRARY to "
                         "libsupertac.so")
    loaded = ctypes.CDLL(str(path))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments
    return loaded


def checked(result: Any, failed: Any = -1) -> Any:
    """The result of a call. Raises ValueError with the library's own words when it failed."""
    if result == failed:
        raise ValueError(library().supertac_error().decode())
    return result


def checked_windows(values: Any, window: tuple[int, int]) -> Array:
    """float32 [N,T,S]. Raises ValueError for another shape."""
    windows = np.ascontiguousarray(values, np.float32)
    if windows.shape[1:] != window:
        raise ValueError(f"windows are [N,{window[0]},{window[1]}], got {list(windows.shape)}")
    return windows


class Drawer:
    """A model file's network, as the programs run it: windows [N,T,S] in the sensor's unit to pictures."""

    def __init__(self, path: Path, settings: dict[str, Any], precision: str = "fp32", threads: int = 1):
        if precision not in PRECISIONS:
            raise ValueError(f"precision {precision!r}: expected one of {', '.join(PRECISIONS)}")
        content, self.library = pathlib.Path(path).read_bytes(), library()
        self.model = checked(self.library.supertac_open_memory(content, len(content), PRECISIONS[precision]), None)
        array = [settings.get(name, value) for name, value in (("rows", 4), ("columns", 4), ("in_channels", 1))]
        self.window = settings["timesteps"], array[0] * array[1] * array[2]
        self.picture = array[0] * settings["scale"], array[1] * settings["scale"]
        self.predicts_error, self.threads = bool(settings.get("spread")), threads

    def __del__(self) -> None:
        if getattr(self, "model", None) is not None:
            self.library.supertac_close(self.model)

    def draw(self, values: Array) -> tuple[Array, Array | None]:
        """Pictures and predicted errors [N,height,width]; these are None for a model without."""
        windows = checked_windows(values, self.window)
        maps = np.empty((2 if self.predicts_error else 1, len(windows), *self.picture), np.float32)
        at = maps.ctypes.data  # it costs a microsecond each time
        errors_at = at + maps.nbytes // 2 if self.predicts_error else None
        checked(self.library.supertac_draw(self.model, len(windows), windows.ctypes.data, at, errors_at, self.threads))
        return maps[0], maps[1] if self.predicts_error else None


def pairs(drawer: Drawer, folder: Path, stride: int) -> tuple[Array, Array]:
    """Of Model.pairs()."""
    opened = checked(drawer.library.supertac_pairs_open(drawer.model, os.fsencode(folder), stride), None)
    try:
        count = drawer.library.supertac_pairs_count(opened)
        windows, truths = (np.empty((count, *shape), np.float32) for shape in (drawer.window, drawer.picture))
        checked(drawer.library.supertac_pairs_read(opened, 0, count, windows.ctypes.data, truths.ctypes.data))
    finally:
        drawer.library.supertac_pairs_close(opened)
    return windows, truths


class LiveWindow:
    """Frames as a sensor gives them, in its unit; push() gives a picture for each as soon as a window is full.

    live = supertac.LiveWindow(supertac.load_model("model.safetensors"), frame_hz=300)
    for time_s, frame in sensor:
        picture = live.push(time_s, frame)
    """

    def __init__(self, model: Model, frame_hz: float, filter_s: float = 0.0, precision: str = "fp32"):
        """filter_s: moving average that the frames have gone through already."""
        self.drawer = model.drawer(precision)
        self.live = checked(library().supertac_live_new(self.drawer.model, frame_hz, filter_s), None)
        self._predicted_error = np.zeros(self.drawer.picture, np.float32)
        self._error_at = self._predicted_error.ctypes.data if self.drawer.predicts_error else None  # costs a microsecond

    def __del__(self) -> None:
        if getattr(self, "live", None) is not None:
            self.drawer.library.supertac_live_free(self.live)

    def push(self, time_s: float, frame: Array) -> Array | None:
        """The picture [height,width] that ends with this frame, or None; predicted_error is then its own."""
        values = np.ascontiguousarray(frame, np.float32)
        if values.size != self.drawer.window[1]:
            raise ValueError(f"a frame has {self.drawer.window[1]} values, got {values.size}")
        checked(self.drawer.library.supertac_live_push(self.live, time_s, values.ctypes.data))
        picture = np.empty(self.drawer.picture, np.float32)
        drawn = checked(self.drawer.library.supertac_live_picture(self.live, picture.ctypes.data, self._error_at))
        return picture if drawn else None

    @property
    def predicted_error(self) -> Array:
        """[height,width], of the last picture; the next one is written over it."""
        return self._predicted_error


class SurfaceMap:
    """One map of the whole surface that was felt, as --map of the programs: add() every picture with its place (that of
    the model's input["delay_s"] ago, where there is one), then cells() gives values and errors [height,width], NaN where
    nothing was felt, and (x, y) of the first cell's corner in mm.
    """

    def __init__(self, model: Model):
        self.drawer = model.drawer()
        self.map = checked(library().supertac_map_new(self.drawer.model), None)

    def __del__(self) -> None:
        if getattr(self, "map", None) is not None:
            self.drawer.library.supertac_map_free(self.map)

    def add(self, x_mm: float, y_mm: float, picture: Array, predicted_error: Array | None = None) -> None:
        maps = [None if m is None else np.ascontiguousarray(m, np.float32) for m in (picture, predicted_error)]
        for one in maps:
            if one is not None and one.shape != self.drawer.picture:
                raise ValueError(f"a picture is {list(self.drawer.picture)}, got {list(one.shape)}")
        at = [None if one is None else one.ctypes.data for one in maps]
        checked(self.drawer.library.supertac_map_add(self.map, x_mm, y_mm, *at))

    def cells(self) -> tuple[Array, Array, tuple[float, float]]:
        height, width, corner = ctypes.c_int(), ctypes.c_int(), (ctypes.c_double * 2)()
        size = [ctypes.addressof(one) for one in (height, width, corner)]
        checked(self.drawer.library.supertac_map_cells(self.map, *size, None, None))
        cells = np.empty((2, height.value, width.value), np.float32)
        checked(self.drawer.library.supertac_map_cells(self.map, *size, cells[0].ctypes.data, cells[1].ctypes.data))
        return cells[0], cells[1], tuple(corner)


def train(recipe: str, folder: Path, out: Path,
          callback: Callable[[int, float], object] | None = None, *, epochs: int = 0, stride: int = 0, seed: int = 0,
          split: str | None = None) -> bool:
    """Trains as supertac-train does, to the same content, on a folder of recordings, and replaces `out`. recipe:
    "paper", "tiny" or "frame".

    callback(step, loss) is called after every step; when it returns something true, training ends early, and False is
    returned and nothing written. epochs and stride: 0 for the recipe's. split: what is kept for testing, "trial" or
    "none", ... Raises ValueError, and whatever the callback raises, KeyboardInterrupt too."""
    raised: list[BaseException] = []

    def progress(_: object, step: int, loss: float) -> int:
        try:
            return 1 if callback is not None and callback(step, loss) else 0
        except BaseException as problem:  # noqa: BLE001: it goes on behind the library
            raised.append(problem)
            return 1

    settings = Settings(ctypes.sizeof(Settings), epochs, stride, seed, None if split is None else split.encode())
    done = library().supertac_train(recipe.encode(), os.fsencode(folder), os.fsencode(out), ctypes.byref(settings),
                                    PROGRESS(progress), None)
    if raised:
        raise raised[0]
    return bool(checked(done) == 1)
