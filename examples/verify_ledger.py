#!/usr/bin/env python3
"""Checks a training's ledger by docs/audit.md alone: the chain of its lines, and every kept state's hashes.

    examples/verify_ledger.py MODEL.run      needs NumPy
"""
import hashlib
import json
import pathlib
import re
import struct
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

try:
    import numpy as np
except ImportError:
    sys.exit("verify_ledger.py: expected NumPy, found none; install it (Debian: apt-get install python3-numpy)")


def in_memory(name, array):
    """A file has PyTorch's order of axes; in memory the kernel's axes come first, then inputs, then outputs."""
    if array.ndim < 2:
        return array
    transposed = re.search(r"decoder\.\d+\.conv\.|\.up\.", name)  # [in,out,k...], others [out,in,k...]
    array = np.moveaxis(array, (0, 1), (-2, -1) if transposed else (-1, -2))
    return array.reshape(array.shape[-2:]) if "attention" in name else array


folder, states = pathlib.Path(sys.argv[1]), 0
lines = (folder / "ledger.jsonl").read_text(encoding="utf-8").splitlines()
names, chain = json.loads(lines[0])["tensors"], hashlib.sha256(lines[0].encode()).hexdigest()
for text in lines[1:]:
    line = json.loads(text)
    chain = hashlib.sha256((chain + text[:text.rindex(',"chain"')] + "}").encode()).hexdigest()
    if chain != line["chain"]:
        sys.exit(f"step {line['step']}: the chain is broken")
    path = folder / "states" / f"{line['step']}.safetensors"
    if path.exists():
        data, states = path.read_bytes(), states + 1
        begin = 8 + struct.unpack("<Q", data[:8])[0]
        header = json.loads(data[8:begin])
        for name, expected in zip(names, line["tensors"], strict=True):
            first, last = header[name]["data_offsets"]
            array = np.frombuffer(data[begin + first:begin + last], "<f4").reshape(header[name]["shape"])
            found = hashlib.sha256(in_memory(name, array).tobytes()).hexdigest()
            if found != expected:
                sys.exit(f"step {line['step']}: {name} of the kept state is not the line's")
print(f"{len(lines) - 1} lines and {states} kept states are as they were written; the last chain is {chain}")
