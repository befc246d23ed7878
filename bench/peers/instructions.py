#!/usr/bin/env python3
"""Instructions of a picture with AVX2 alone, in fp32 and int8, counted by valgrind's callgrind, which knows no wider set.

    bench/peers/instructions.py MODEL [--bin BUILD/bin] [--out bench/results/speed/instructions.csv]

What a call costs is the difference of six calls and two, divided by four; of the functions that take most, `products`
are those that multiply.
"""
import argparse
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench"))
from source import source  # noqa: E402

PRODUCTS = re.compile("run_widened|places|product|run_on_avx2.*(sums|single_sum)|plane_rows")


def counted(program, model, precision, calls, batch):
    """Function -> instructions."""
    with tempfile.TemporaryDirectory() as folder:
        out = f"{folder}/callgrind"
        subprocess.run(["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", program, model, precision, str(calls),
                        str(batch)], check=True, capture_output=True)
        told = subprocess.run(["callgrind_annotate", "--threshold=100", out], check=True, capture_output=True, text=True).stdout
    found = {}
    for line in told.splitlines():
        if match := re.match(r"\s*([\d,]+) \([^)]*\)\s+\S+?:(.*)", line):
            found[match[2]] = found.get(match[2], 0) + int(match[1].replace(",", ""))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model")
    parser.add_argument("--bin", default=ROOT / "build-dev/bin", help="where first_picture is (-DSUPERTAC_BENCH=ON)")
    parser.add_argument("--out", default=ROOT / "bench/results/speed/instructions.csv")
    options, lines = parser.parse_args(), []
    for precision in ("fp32", "int8"):
        for batch in (1, 64):
            few, more = (counted(pathlib.Path(options.bin) / "first_picture", options.model, precision, n, batch) for n in (2, 6))
            each = {name: (count - few.get(name, 0)) / 4 / batch for name, count in more.items()}
            lines.append({"precision": precision, "batch": batch, "instructions": round(sum(each.values())),
                          "of_products": round(sum(n for name, n in each.items() if PRODUCTS.search(name)))})
            print(*lines[-1].values(), flush=True)
    with open(options.out, "w", newline="") as file:
        table = csv.DictWriter(file, [*lines[0], *source()], lineterminator="\n")
        table.writeheader()
        table.writerows(line | source() for line in lines)


if __name__ == "__main__":
    main()
