"""An array of your own, live, as its file describes it (docs/sensors.md), read by the C library.

    sensor = supertac.Sensor("mat.json")
    for frame in sensor.open():
        print(frame.time_s, frame.signals)          # [S], in the sensor's unit
"""
from __future__ import annotations

import ctypes
import json
import os
from typing import Any, NamedTuple, Optional

import numpy as np

from .files import Array, Path
from .library import SIZE, checked, library
from .recordings import Recording

WAIT_S = 0.2  # after which Ctrl-C is heard
ENDED = 2


class Description(ctypes.Structure):
    """supertac_sensor_description"""
    _fields_ = [("size", SIZE), ("name", ctypes.c_char_p), ("unit", ctypes.c_char_p), ("port", ctypes.c_char_p),
                ("rows", ctypes.c_int), ("columns", ctypes.c_int), ("channels", ctypes.c_int), ("signals", ctypes.c_int),
                ("pitch_mm", ctypes.c_double * 2), ("rate_hz", ctypes.c_double), ("rest", ctypes.c_double),
                ("span", ctypes.c_double)]


class About(ctypes.Structure):
    """supertac_frame"""
    _fields_ = [("time_s", ctypes.c_double), ("total_force", ctypes.c_double), ("saturated", SIZE)]


class Frame(NamedTuple):
    """One frame: its time on the sensor's clock, its signals [S] in the sensor's unit, row by row, the sum of its taxels' shares
    of their range, and how many signals are at the end of it."""
    time_s: float
    signals: Array
    total_force: float
    saturated: int


class Probe(NamedTuple):
    """What a port was heard to send: lines for people, and what the sensor's file should be, or None."""
    says: list[str]
    draft: Optional[dict[str, Any]]


class _Handle:
    def __init__(self, path: Path):
        self.library = library()
        self.sensor = checked(self.library.supertac_sensor_new(os.fsencode(path)), None)

    def __del__(self) -> None:
        if getattr(self, "sensor", None) is not None:
            self.library.supertac_sensor_free(self.sensor)


class Sensor:
    """The file of a sensor, or "rig". Raises ValueError naming the key, what was expected and found."""

    def __init__(self, path: Path):
        self.path, handle, about = path, _Handle(path), Description(ctypes.sizeof(Description))
        checked(handle.library.supertac_sensor_describe(handle.sensor, ctypes.byref(about)))
        self.name, self.unit, self.port = (text.decode() for text in (about.name, about.unit, about.port))
        self.rows, self.columns, self.channels = about.rows, about.columns, about.channels
        self.pitch_mm, self.rate_hz = list(about.pitch_mm), about.rate_hz
        self.range = sorted((about.rest, about.rest - about.span))
        self.pressed = "higher" if about.span < 0 else "lower"

    def __repr__(self) -> str:
        return (f"Sensor({self.name!r}: {self.rows}x{self.columns} taxels, {self.channels} each, in {self.unit}, "
                f"{self.rate_hz:g} Hz, at {self.port})")

    def open(self, port: str | None = None) -> Frames:
        """Its frames from now on, oldest first; 4096 wait for who is slow. `port`: another than the file's."""
        return Frames(self, port)

    def probe(self, seconds: float = 3, port: str | None = None) -> Probe:
        """Listens, and says what comes, as supertac-stream --probe does."""
        handle = _Handle(self.path)
        text = handle.library.supertac_sensor_probe(handle.sensor, None if port is None else port.encode(), seconds)
        return Probe(**json.loads(checked(text, None)))

    def record(self, seconds: float, port: str | None = None) -> Recording:
        """A recording of so many seconds by the sensor's clock, for write_recording() and Model.windows()."""
        times: list[float] = []
        signals: list[Array] = []
        with self.open(port) as frames:
            for frame in frames:
                times.append(frame.time_s)
                signals.append(frame.signals)
                if frame.time_s - times[0] >= seconds:
                    break
        array = {"rows": self.rows, "columns": self.columns, "pitch_mm": self.pitch_mm, "channels": self.channels}
        scale = json.dumps({"unit": self.unit, "pressed": self.pressed, "range": self.range})
        return Recording(np.array(times), np.array(signals, np.float32).reshape(len(times), -1), array=array,
                         metadata={"signals": scale, "source": "streamed"})


class Frames:
    """What Sensor.open() gives: an iterator that ends where the source does, and a context that closes the port.
    Raises ValueError when the port is gone, falls silent, or is another device than its file says."""

    def __init__(self, sensor: Sensor, port: str | None = None):
        self._handle: _Handle | None = _Handle(sensor.path)
        self._next = self._handle.library.supertac_sensor_next
        self._about, self._signals = About(), np.empty(sensor.rows * sensor.columns * sensor.channels, np.float32)
        self._at = self._handle.sensor, WAIT_S, ctypes.byref(self._about), self._signals.ctypes.data
        checked(self._handle.library.supertac_sensor_start(self._handle.sensor, None if port is None else port.encode()))

    def __iter__(self) -> Frames:
        return self

    def __next__(self) -> Frame:
        while self._handle is not None:
            found = checked(self._next(*self._at))
            if found == 1:
                return Frame(self._about.time_s, self._signals.copy(), self._about.total_force, self._about.saturated)
            if found == ENDED:
                break
        raise StopIteration

    @property
    def lost(self) -> tuple[int, int]:
        """Frames so far that did not arrive whole, and that were not taken in time."""
        if self._handle is None:
            raise ValueError("the sensor is closed")
        missing, dropped = ctypes.c_ulonglong(), ctypes.c_ulonglong()
        checked(self._handle.library.supertac_sensor_lost(self._handle.sensor, ctypes.byref(missing), ctypes.byref(dropped)))
        return missing.value, dropped.value

    def close(self) -> None:
        self._handle = None

    def __enter__(self) -> Frames:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
