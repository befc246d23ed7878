#!/usr/bin/env python3
"""Writes version_1.safetensors by its own means: what version 1 of the format is, said a second time."""
import json
import struct
import zlib

data = struct.pack("<6f", 0.0, 0.5, -1.0, 1e-3, 2.5, 3.0) + struct.pack("<2d", 0.1, 1e300) + bytes([1, 2, 3])
header = {
    "__metadata__": {"checksum": "00000000", "note": "quotes \" and \u00e4", "supertac_format": "1"},
    "volts": {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]},
    "time_s": {"dtype": "F64", "shape": [2], "data_offsets": [24, 40]},
    "bytes": {"dtype": "U8", "shape": [3], "data_offsets": [40, 43]},
    "empty": {"dtype": "I64", "shape": [0, 4], "data_offsets": [43, 43]},
}
text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
text += b" " * (-len(text) % 8)
checksum = b"%08x" % zlib.crc32(data, zlib.crc32(text))
text = text.replace(b'"checksum":"00000000"', b'"checksum":"' + checksum + b'"')
with open("version_1.safetensors", "wb") as file:
    file.write(struct.pack("<Q", len(text)) + text + data)
