#!/usr/bin/env python3
"""Packs a fuzzer's corpus into one file, and out again.

    pack.py pack FOLDER FILE      after a campaign: every file of FOLDER becomes a case of FILE
    pack.py unpack FILE FOLDER    before one: what a fuzz target takes as its corpus

A case is a line "LENGTH NAME" and LENGTH bytes; tests/fuzz/corpus.h reads the same.
"""

import pathlib
import sys


def pack(folder, file):
    cases = sorted(pathlib.Path(folder).iterdir())
    pathlib.Path(file).write_bytes(b"".join(b"%d %s\n" % (len(data), name.encode()) + data
                                            for name, data in ((c.name, c.read_bytes()) for c in cases)))


def unpack(file, folder):
    rest = pathlib.Path(file).read_bytes()
    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    while rest:
        head, _, rest = rest.partition(b"\n")
        length, name = head.split(b" ", 1)
        (pathlib.Path(folder) / name.decode()).write_bytes(rest[:int(length)])
        rest = rest[int(length):]


if len(sys.argv) != 4 or sys.argv[1] not in ("pack", "unpack"):
    sys.exit(__doc__)
{"pack": pack, "unpack": unpack}[sys.argv[1]](*sys.argv[2:])
