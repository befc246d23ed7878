#!/usr/bin/env python3
"""Checks a training's ledger without any of our programs: every line's chain, and every kept state against its line.

    examples/verify_ledger.py model.run

docs/audit.md says which bytes are hashed. The states need NumPy, which turns a file's order of axes into memory's.
"""
import hashlib
import json
import pathlib
import re
import struct
import sys

import numpy as np


def in_memory(name, array):
    """A file has PyTorch's order of axes; in memory the kernel's axes come first, then inputs, then outputs."""
    if array.ndim < 2:
        return array
    transposed = re.search(r"decoder\.\d+\.conv\.|\.up\.", name)  # [in,out,k...], others [out,in,k...]
    array = np.moveaxis(array, (0, 1), (-2, -1) if transposed else (-1, -2))
    return array.reshape(array.shape[-2:]) if "attention" in name else array


def main(folder):
    with open(folder / "ledger.jsonl", encoding="utf-8") as file:
        lines = file.read().splitlines()
    header, states = json.loads(lines[0]), 0
    chain = hashlib.sha256(lines[0].encode()).hexdigest()
    for text in lines[1:]:
        line = json.loads(text)
        content = text[:text.rindex(',"chain"')] + "}"
        chain = hashlib.sha256((chain + content).encode()).hexdigest()
        assert chain == line["chain"], f"step {line['step']}: the chain is broken"
        path = folder / "states" / f"{line['step']}.safetensors"
        if path.exists():
            data = path.read_bytes()
            begin = 8 + struct.unpack("<Q", data[:8])[0]
            arrays = {name: np.frombuffer(data[begin + info["data_offsets"][0]:begin + info["data_offsets"][1]], "<f4")
                      .reshape(info["shape"]) for name, info in json.loads(data[8:begin]).items() if "shape" in info}
            for name, expected in zip(header["tensors"], line["tensors"]):
                found = hashlib.sha256(in_memory(name, arrays[name]).tobytes()).hexdigest()
                assert found == expected, f"step {line['step']}: {name} of the kept state is not the line's"
            states += 1
    print(f"{len(lines) - 1} lines, {states} kept states: as they were written; last chain {chain}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
