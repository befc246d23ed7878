#!/usr/bin/env python3
"""Checks a training's ledger by docs/audit.md alone: the chain of its lines, and every kept state's hashes. Of two
ledgers, or of two steps that supertac-check opened with --json, it names the first difference instead.

    examples/verify_ledger.py MODEL.run      needs NumPy
    examples/verify_ledger.py ONE.run/ledger.jsonl OTHER.run/ledger.jsonl
    examples/verify_ledger.py one.json other.json
"""
import hashlib
import itertools
import json
import pathlib
import re
import struct
import sys


def ledger(path):
    """A ledger's header and lines, the chain checked; one torn off at the end, as its run was killed, is left out."""
    with open(path, "rb") as file:
        texts = (text[:-1] for text in file if text.endswith(b"\n"))
        header = next(texts, b"")
        if b'"format":"supertac-ledger-2"' not in header:
            sys.exit(f"{path}: expected a ledger of supertac-train --ledger, found none")
        chain = hashlib.sha256(header).hexdigest()
        yield {**json.loads(header), "chain": chain}
        for number, text in enumerate(texts, 2):
            body, _, its = text.rpartition(b',"chain":"')
            chain = hashlib.sha256(chain.encode() + body + b"}").hexdigest()
            if its != chain.encode() + b'"}':
                sys.exit(f"{path}, line {number}: the chain is broken; a line was changed after it had been written")
            yield json.loads(text)


def rows(path):
    """What can differ: the arrays of each line of a ledger, or what went into each operator and came out of it. The
    first row has nothing but a name, by which two of different networks are told apart."""
    if path.endswith(".json"):
        with open(path, encoding="utf-8") as file:
            step = json.load(file)
        yield f"step {step['step']} of {len(step['operators'])} operators", {}
        for ran in step["operators"]:
            yield ran["name"], {**{f"input {i}": x for i, x in enumerate(ran.get("inputs", []))},
                                "the settings": ran.get("settings"),
                                **{f"output {i}": x for i, x in enumerate(ran["outputs"])}}
        return
    lines = ledger(path)
    header = next(lines)
    yield f"a line every {header['every']} steps of {len(header['tensors'])} tensors", {}
    for line in lines:
        yield f"step {line['step']}", dict(zip(header["tensors"], line["tensors"], strict=True),
                                           **{"the batches": line["batches"]})


def compare(one, other):
    """Exits at the first difference; a ledger that ends earlier is none."""
    same, ended = -1, None
    for mine, its in itertools.zip_longest(rows(one), rows(other)):
        if mine is None or its is None:
            ended = one if mine is None else other
            continue
        if mine[0] != its[0] or mine[1].keys() != its[1].keys():
            sys.exit(f"{one}, {other}: expected two of the same network and recipe, found {mine[0]} and {its[0]}")
        for what in mine[1]:
            if mine[1][what] != its[1][what]:
                sys.exit(f"{mine[0]}, {what}: {mine[1][what]} and {its[1][what]}")
        same += 1
    print(f"the same in {same} rows" + (f"; {ended} ends earlier" if ended else ""))


def in_memory(np, name, array):
    """A file has PyTorch's order of axes; in memory the kernel's axes come first, then inputs, then outputs."""
    if array.ndim < 2:
        return array
    transposed = re.search(r"decoder\.\d+\.conv\.|\.up\.", name)  # [in,out,k...], others [out,in,k...]
    array = np.moveaxis(array, (0, 1), (-2, -1) if transposed else (-1, -2))
    return array.reshape(array.shape[-2:]) if "attention" in name else array


def verify(folder):
    """The ledger's chain, and the hashes of every state kept beside it."""
    try:
        import numpy as np
    except ImportError:
        sys.exit("verify_ledger.py: expected NumPy, found none; install it (Debian: apt-get install python3-numpy)")
    lines, count, states = ledger(folder / "ledger.jsonl"), 0, 0
    line = next(lines)
    names = line["tensors"]
    for count, line in enumerate(lines, 1):
        path = folder / "states" / f"{line['step']}.safetensors"
        if not path.exists():
            continue
        data, states = path.read_bytes(), states + 1
        begin = 8 + struct.unpack("<Q", data[:8])[0]
        header = json.loads(data[8:begin])
        for name, expected in zip(names, line["tensors"], strict=True):
            entry = header.get(name, {"data_offsets": (0, 0), "shape": [0]})  # no epoch was scored yet
            first, last = entry["data_offsets"]
            array = np.frombuffer(data[begin + first:begin + last], "<f4").reshape(entry["shape"])
            array = in_memory(np, name, array) if array.size else array
            found = hashlib.sha256(array.tobytes()).hexdigest()
            if found != expected:
                sys.exit(f"step {line['step']}: {name} of the kept state is not the line's")
    print(f"{count} lines and {states} kept states are as they were written; the last chain is {line['chain']}")


if len(sys.argv) not in (2, 3) or sys.argv[1] in ("-h", "--help"):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)
try:
    if len(sys.argv) == 3:
        compare(sys.argv[1], sys.argv[2])
    else:
        verify(pathlib.Path(sys.argv[1]))
except (OSError, ValueError, KeyError, TypeError, struct.error) as error:
    sys.exit(f"{' '.join(sys.argv[1:])}: expected what supertac-train and supertac-check wrote, found {error!r}")
