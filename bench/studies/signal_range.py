#!/usr/bin/env python3
"""What --range auto finds where an array's numbers are none of the rig's: 3x5 taxels, signals from 68 to 102.

    bench/studies/signal_range.py BIN RESULTS.csv [BIN_BEFORE]

Simulated passes over two plates are trained on with three ranges by preset tiny, the same data and epochs; the other
trial is scored; five seeds where the range is taken, one where it is refused. BIN_BEFORE holds programs from before
training looked at the signals. About a quarter of an hour.
"""
import csv
import json
import pathlib
import struct
import subprocess
import sys
import tempfile

import numpy as np

RIG = "2.45,0.36"


def run(folder, program, *words):
    return subprocess.run([folder / program, *map(str, words), "--quiet"], capture_output=True, text=True)


def in_other_numbers(path):
    """Writes the recording's signals as numbers from 68 to 102, 100 at rest; the file has no checksum then."""
    raw = path.read_bytes()
    size = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8:8 + size])
    data = bytearray(raw[8 + size:])
    begin, end = header["volts"]["data_offsets"]
    volts = np.frombuffer(data[begin:end], "<f4")
    data[begin:end] = (100 - (np.float32(2.45) - volts) / np.float32(0.36) * 35).astype("<f4").tobytes()
    for key in ("checksum", "supertac_format"):
        header["__metadata__"].pop(key, None)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data)


def measured(programs, data, model, given, seed):
    """Contact SSIM on the other trial, and what training said where it refused."""
    trained = run(programs, "supertac-train", "--data", data, "--out", model, "--preset", "tiny", "--epochs", 30, "--stride", 2,
                  "--force", "--seed", seed, *given)
    if trained.returncode != 0:
        return "", trained.stderr.strip().splitlines()[-1].partition(": ")[2]
    scores = json.loads(run(programs, "supertac-evaluate", "--data", data, "--model", model, "--json", "-").stdout)
    found = json.loads(run(programs, "supertac-info", model, "--json", "-").stdout)["metadata"]["input"]
    found = json.loads(found) if isinstance(found, str) else found
    return f"{scores['contact']['ssim']:.3f}", f"{found['rest_volts']:.4g},{found['span_volts']:.4g}"


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    now = pathlib.Path(sys.argv[1])
    with tempfile.TemporaryDirectory() as name, open(sys.argv[2], "w", newline="") as file:
        data, model = pathlib.Path(name) / "data", pathlib.Path(name) / "model.safetensors"
        run(now, "supertac-simulate", "--out", data, "--array", "3x5", "--pitch", 2.5, "--plates", "ridges6,bumps12", "--speeds", 10,
            "--passes", 4)
        for path in data.glob("*.safetensors"):
            in_other_numbers(path)
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["programs", "range", "seed", "contact_ssim", "range in the model, or why it was refused"])
        cases = [("now", now, "auto"), ("now", now, "100,35"), ("now", now, RIG)]
        if len(sys.argv) == 4:
            cases += [("before", pathlib.Path(sys.argv[3]), given) for given in ("none given", "100,35")]
        for label, programs, given in cases:
            for seed in range(1 if given == RIG else 5):
                row = [label, given, seed, *measured(programs, data, model, [] if given == "none given" else ["--range", given], seed)]
                table.writerow(row)
                print(*row, flush=True)


if __name__ == "__main__":
    main()
