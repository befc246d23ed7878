"""The project's one file format, safetensors, with the checks of io/files/safetensors.h: a file of
unknown origin raises ValueError and takes no more memory than it has bytes."""
from __future__ import annotations

import json
import math
import os
import pathlib
import struct
import zlib
from typing import Any, Union

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Path = Union[str, "os.PathLike[str]"]

TYPES = {"F64": "<f8", "F32": "<f4", "I64": "<i8", "I32": "<i4", "U8": "u1"}
LARGEST_HEADER, MOST_TENSORS, MOST_FIELDS, HIGHEST_RANK = 1 << 20, 8192, 4096, 8


def parse_json(path: Path, text: str | bytes) -> Any:
    """JSON without keys that appear twice and without NaN. Raises ValueError naming the file."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        if len(dict(pairs)) != len(pairs):
            raise ValueError("a key appears twice")
        return dict(pairs)

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no JSON")

    try:
        return json.loads(text, object_pairs_hook=unique, parse_constant=refuse)
    except (ValueError, RecursionError) as problem:
        raise ValueError(f"{path}: its JSON cannot be read: {problem}") from None


def _whole(path: Path, raw: bytes, metadata: dict[str, str]) -> None:
    """Raises ValueError unless header and data have the checksum that the metadata name; other writers name none."""
    found = metadata.get("checksum")
    if found is None:
        return
    at = raw.find(f'"checksum":"{found}"'.encode(), 8) + len('"checksum":"')
    if len(found) != 8 or f"{zlib.crc32(raw[at + 8:], zlib.crc32(b'0' * 8, zlib.crc32(raw[8:at]))):08x}" != found:
        raise ValueError(f"{path}: the checksum is not {found}: the file is damaged; copy it again")


def _entry(entry: Any) -> tuple[str, list[int], int, int] | None:
    """Type, shape and offsets of a tensor's entry in the header; None where it is not as expected."""
    if not isinstance(entry, dict) or set(entry) != {"dtype", "shape", "data_offsets"}:
        return None
    kind, shape, offsets = entry["dtype"], entry["shape"], entry["data_offsets"]
    lists = isinstance(shape, list) and isinstance(offsets, list) and len(offsets) == 2 and len(shape) <= HIGHEST_RANK
    if not lists or kind not in TYPES or not all(type(n) is int and 0 <= n < 1 << 63 for n in shape + offsets):
        return None
    size = math.prod(shape) * np.dtype(TYPES[kind]).itemsize
    return (TYPES[kind], shape, *offsets) if offsets[1] - offsets[0] == size else None


def read(path: Path) -> tuple[dict[str, Array], dict[str, str]]:
    """Tensors by name and metadata of a safetensors file. Raises ValueError naming the file and what is wrong."""
    raw = pathlib.Path(path).read_bytes()
    size = struct.unpack("<Q", raw[:8])[0] if len(raw) >= 8 else len(raw)
    if size > min(LARGEST_HEADER, len(raw) - 8) or raw[8:9] != b"{":
        raise ValueError(f"{path}: expected a safetensors file, found {len(raw)} bytes of something else")
    header = parse_json(path, raw[8 : 8 + size])
    metadata = header.pop("__metadata__", {})
    if not isinstance(metadata, dict) or not all(isinstance(text, str) for text in metadata.values()):
        raise ValueError(f"{path}: its metadata are not an object of texts")
    if len(header) > MOST_TENSORS or len(metadata) > MOST_FIELDS:
        raise ValueError(f"{path}: has {len(header)} tensors and {len(metadata)} fields, expected at most "
                         f"{MOST_TENSORS} and {MOST_FIELDS}")
    _whole(path, raw, metadata)
    entries = {}
    for name, given in header.items():
        entry = _entry(given)
        if entry is None:
            raise ValueError(f"{path}: tensor {name!r} has a type, a shape or offsets that cannot be")
        entries[name] = entry
    tensors, at = {}, 0
    for name, (kind, shape, begin, end) in sorted(entries.items(), key=lambda item: item[1][2:]):
        if begin != at or end > len(raw) - 8 - size:
            raise ValueError(f"{path}: tensor {name!r} lies at {begin} to {end}, expected it to begin at {at} and to "
                             f"end within {len(raw) - 8 - size} bytes")
        tensors[name] = np.frombuffer(raw, kind, math.prod(shape), 8 + size + begin).reshape(shape)
        at = end
    if at != len(raw) - 8 - size:
        raise ValueError(f"{path}: has {len(raw) - 8 - size - at} bytes behind the last tensor")
    return {name: tensors[name] for name in header}, metadata


def expect(path: Path, tensors: dict[str, Array], shapes: dict[str, list[Any]]) -> list[Any]:
    """The named tensors, None for those that are not there. `shapes`: name to sizes, where None is any size and a text
    the same size wherever it stands; a name that ends in "?" need not be there. Raises ValueError."""
    sizes: dict[str, int] = {}
    found: list[Any] = []
    for key, shape in shapes.items():
        name = key.rstrip("?")
        if name not in tensors:
            if key.endswith("?"):
                found.append(None)
                continue
            raise ValueError(f"{path}: has no tensor {name!r}; found {sorted(tensors)}")
        have = tensors[name].shape
        if len(have) != len(shape) or any(
                size is not None and n != (size if isinstance(size, int) else sizes.setdefault(size, n))
                for size, n in zip(shape, have)):
            raise ValueError(f"{path}: tensor {name!r} has shape {list(have)}, which does not fit the others")
        found.append(tensors[name])
    return found


def write(path: Path, tensors: dict[str, Array], metadata: dict[str, str] | None = None,
          checksum: bool = False) -> None:
    """Writes arrays by name, the file complete or not at all; without our checksum, as a program of another maker would,
    or with it."""
    if checksum:
        metadata = {"checksum": "0" * 8, **(metadata or {}), "supertac_format": "1"}
    header: dict[str, Any] = {} if metadata is None else {"__metadata__": metadata}
    at = 0
    names = {np.dtype(text): name for name, text in TYPES.items()}
    for name, array in tensors.items():
        header[name] = {"dtype": names[array.dtype], "shape": list(array.shape), "data_offsets": [at, at + array.nbytes]}
        at += array.nbytes
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    parts = [struct.pack("<Q", len(text)), text, *(array.tobytes() for array in tensors.values())]
    whole = b"".join(parts)
    if checksum:
        whole = whole.replace(b'"checksum":"00000000"', b'"checksum":"%08x"' % zlib.crc32(whole[8:]), 1)
    unfinished = pathlib.Path(f"{path}.{os.getpid()}.tmp")
    try:
        unfinished.write_bytes(whole)
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)
