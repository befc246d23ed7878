#!/usr/bin/env python3
"""Checks a training's ledger by docs/audit.md alone: the chain of its lines, and every kept state's hashes. Of two
ledgers, or of two steps that supertac-check opened with --json, it names the first difference instead.

    examples/verify_ledger.py MODEL.run      needs NumPy
    examples/verify_ledger.py ONE.run/ledger.jsonl OTHER.run/ledger.jsonl
    examples/verify_ledger.py one.json other.json
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



def rows(path):
    """What can differ: the arrays of each line of a ledger, or what went into each operator and came out of it."""
    with open(path, encoding="utf-8") as file:
        if path.endswith(".json"):
            for ran in json.load(file)["operators"]:
                yield ran["name"], {**{f"input {i}": x for i, x in enumerate(ran.get("inputs", []))},
                                    "the settings": ran.get("settings"),
                                    **{f"output {i}": x for i, x in enumerate(ran["outputs"])}}
            return
        names = json.loads(file.readline())["tensors"]
        for line in map(json.loads, file):
            yield f"step {line['step']}", dict(zip(names, line["tensors"]), **{"the batches": line["batches"]})


if len(sys.argv) == 3:
    same = 0
    for (name, mine), (its_name, its) in zip(rows(sys.argv[1]), rows(sys.argv[2])):
        if name != its_name or mine.keys() != its.keys():
            sys.exit(f"{sys.argv[1]}, {sys.argv[2]}: expected two of the same network and recipe, found {name} and "
                     f"{its_name}")
        for what in mine:
            if mine[what] != its[what]:
                sys.exit(f"{name}, {what}: {mine[what]} and {its[what]}")
        same += 1
    print(f"the same in {same} rows, as far as both go")
    sys.exit(0)

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
