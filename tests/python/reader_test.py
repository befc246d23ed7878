#!/usr/bin/env python3
"""Files of unknown origin, read by the package in python/: ValueError each time, and no more memory than they have bytes.

77 when NumPy is not installed.
"""
import json
import pathlib
import resource
import struct
import sys
import tempfile

from ours import np, supertac

RECORDING = {"__metadata__": {"kind": "recording"}}


def entry(kind, shape, offsets):
    return {"dtype": kind, "shape": shape, "data_offsets": offsets}


def recording(times, volts=None, **more):
    data = np.array(times, "<f8").tobytes()
    size = len(data) + 64 * len(times)
    return RECORDING | {"time_s": entry("F64", [len(times)], [0, len(data)]),
                        "volts": volts or entry("F32", [len(times), 16], [len(data), size]), **more}, \
        data + b"\0" * (size - len(data))


BAD = {
    "negative offsets": (RECORDING | {"time_s": entry("F64", [2], [-16, 0]), "volts": entry("F32", [1], [0, 4])}, b"\0" * 4),
    "offsets behind the end": (RECORDING | {"time_s": entry("F64", [2], [0, 10**18])}, b"\0" * 64),
    "a shape beyond 64 bits": (RECORDING | {"time_s": entry("F64", [1 << 62, 8], [0, 0])}, b""),
    "a shape of another size": (RECORDING | {"time_s": entry("F64", [3], [0, 16])}, b"\0" * 16),
    "a size that is true": ({"x": entry("U8", [True], [0, 1])}, b"\0"),
    "an unknown type": ({"x": entry("F4", [1], [0, 1])}, b"\0"),
    "one name twice": (b'{"x":{"dtype":"F32","shape":[1],"data_offsets":[0,4]},"x":{"dtype":"F32","shape":[1],"data_offsets":[4,8]}}',
                       b"\0" * 8),
    "nested": (b'{"a":' + b"[" * 400000 + b"]" * 400000 + b"}", b""),
    "NaN": (b'{"a":NaN}', b""),
    "no UTF-8": (b'{"\xff":1}', b""),
    "metadata that are a list": ({"__metadata__": [1]}, b""),
    "metadata that hold a number": ({"__metadata__": {"kind": 1}}, b""),
    "an entry without offsets": ({"x": {}}, b""),
    "an entry that is a text": ({"x": "F32"}, b""),
    "overlapping tensors": ({f"x{i}": entry("U8", [1000000], [0, 1000000]) for i in range(2500)}, b"\0" * 1000000),
    "a hole": ({"x": entry("U8", [1], [1, 2])}, b"\0\0"),
    "bytes at the end": ({"x": entry("U8", [1], [0, 1])}, b"\0\0"),
    "no tensors": (RECORDING, b""),
    "a wrong checksum": ({"__metadata__": {"kind": "recording", "checksum": "00000000"}}, b""),
    "a checksum that is none": ({"__metadata__": {"kind": "recording", "checksum": "no"}}, b""),
    "times that fall": recording([1, 0]),
    "times that are not numbers": recording([0, float("nan")]),
    "volts of another length": recording([0, 1], volts=entry("F32", [16, 2], [16, 144])),
    "positions of another length": recording([0, 1], position_mm=entry("F32", [1, 2], [144, 152])),
    "an array that is none": ({"__metadata__": {"kind": "recording", "array": "[]"}}, b""),
    "another kind": ({"__metadata__": {"kind": "model"}}, b""),
}

resource.setrlimit(resource.RLIMIT_AS, (4 << 30,) * 2)
bad = 0
with tempfile.TemporaryDirectory() as folder:
    path = pathlib.Path(folder) / "file.safetensors"
    path.write_bytes(b"")
    cases = {"empty": None, **BAD}
    for name, case in cases.items():
        if case is not None:
            header = case[0] if isinstance(case[0], bytes) else json.dumps(case[0]).encode()
            path.write_bytes(struct.pack("<Q", len(header)) + header + case[1])
        for read in (supertac.read_recording, supertac.read_pictures, supertac.load_model):
            try:
                read(path)
                found = "nothing"
            except ValueError as error:
                found = None if str(path) in str(error) else f"a message without the file: {error}"
            except BaseException as error:  # noqa: BLE001
                found = repr(error)[:100]
            if found:
                bad += 1
                print(f"{name}: {read.__name__}: expected a ValueError that names the file, found {found}")
    header, data = recording([0, 1, 2])
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)
    assert supertac.read_recording(path).volts.shape == (3, 16)
megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
if megabytes > 300:
    bad += 1
    print(f"{megabytes} MB were needed, expected at most 300")
print(f"{len(cases)} files, {bad} read wrongly, {megabytes} MB")
sys.exit(bad > 0)
