"""The project's one file format, safetensors, with the checks of io/files/safetensors.h that matter to a reader."""
import json
import pathlib
import struct
import zlib

import numpy as np

TYPES = {"F64": "<f8", "F32": "<f4", "I64": "<i8", "I32": "<i4", "U8": "u1"}
LARGEST_HEADER = 1 << 20


def _whole(path, raw, header):
    """Raises ValueError unless header and data have the checksum that the metadata name; other writers name none."""
    found = header.get("__metadata__", {}).get("checksum")
    if found is None:
        return
    at = raw.find(f'"checksum":"{found}"'.encode(), 8) + len('"checksum":"')
    if zlib.crc32(raw[8:at] + b"0" * 8 + raw[at + 8 :]) != int(found, 16):
        raise ValueError(f"{path}: the checksum is not {found}: the file is damaged; copy it again")


def read(path):
    """Tensors by name and metadata of a safetensors file. Raises ValueError naming the file and what is wrong."""
    raw = pathlib.Path(path).read_bytes()
    size = struct.unpack("<Q", raw[:8])[0] if len(raw) >= 8 else len(raw)
    if size > min(LARGEST_HEADER, len(raw) - 8) or raw[8:9] != b"{":
        raise ValueError(f"{path}: expected a safetensors file, found {len(raw)} bytes of something else")
    header = json.loads(raw[8 : 8 + size])
    _whole(path, raw, header)
    metadata = header.pop("__metadata__", {})
    tensors = {}
    for name, entry in header.items():
        begin, end = (8 + size + offset for offset in entry["data_offsets"])
        tensors[name] = np.frombuffer(raw[begin:end], TYPES[entry["dtype"]]).reshape(entry["shape"])
    return tensors, metadata


def write(path, tensors, metadata=None):
    """Writes arrays by name, as a program of another maker would: without our checksum."""
    header, at = {} if metadata is None else {"__metadata__": metadata}, 0
    names = {np.dtype(text): name for name, text in TYPES.items()}
    for name, array in tensors.items():
        header[name] = {"dtype": names[array.dtype], "shape": list(array.shape), "data_offsets": [at, at + array.nbytes]}
        at += array.nbytes
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    parts = [struct.pack("<Q", len(text)), text, *(array.tobytes() for array in tensors.values())]
    pathlib.Path(path).write_bytes(b"".join(parts))
