#!/usr/bin/env python3
"""Shows that the bits of OpenBLAS's cblas_sgemm depend on the processor and on the number of threads.

    bench/sgemm_bits.py [BATCH]

Multiplies the matrices of preset paper's 3x3 convolution at 16x16 pixels ([256 BATCH, 288] x [288, 32], the same
numbers every time; BATCH is 64 unless given) with the kernels of several processors, which OPENBLAS_CORETYPE chooses
when the library is loaded, and with one and two threads. Prints for each how many of the sums differ from those of the
first line, and by how much. Kernels that this processor cannot run are left out.
"""

import array
import ctypes
import os
import random
import subprocess
import sys

ROWS_OF_A_PICTURE, INNER, COLUMNS = 256, 288, 32
ROW_MAJOR, NO_TRANSPOSE = 101, 111


def product(rows, threads):
    """The product's bytes, and the name of the kernels that made it, as this process's OpenBLAS computes it."""
    blas = ctypes.CDLL("libopenblas.so.0")
    blas.openblas_get_corename.restype = ctypes.c_char_p
    blas.openblas_set_num_threads(threads)
    rng = random.Random(1)
    a = array.array("f", (rng.gauss(0, 1) for _ in range(rows * INNER)))
    b = array.array("f", (rng.gauss(0, 0.1) for _ in range(INNER * COLUMNS)))
    c = array.array("f", bytes(4 * rows * COLUMNS))
    pointers = [(ctypes.c_float * len(x)).from_buffer(x) for x in (a, b, c)]
    one, zero = ctypes.c_float(1), ctypes.c_float(0)
    blas.cblas_sgemm(ROW_MAJOR, NO_TRANSPOSE, NO_TRANSPOSE, rows, COLUMNS, INNER, one, pointers[0], INNER,
                     pointers[1], COLUMNS, zero, pointers[2], COLUMNS)
    return c.tobytes(), blas.openblas_get_corename().decode()


def main():
    if sys.argv[1:2] == ["--child"]:
        sums, name = product(int(sys.argv[2]), int(sys.argv[3]))
        sys.stdout.buffer.write(name.encode() + b"\n" + sums)
        return
    rows = ROWS_OF_A_PICTURE * int(sys.argv[1] if len(sys.argv) > 1 else 64)
    first = None
    for core in ("Haswell", "Zen", "SkylakeX", "Sandybridge", "Nehalem"):
        for threads in (1, 2):
            run = subprocess.run([sys.executable, __file__, "--child", str(rows), str(threads)], capture_output=True,
                                 env=dict(os.environ, OPENBLAS_CORETYPE=core))
            name, _, data = run.stdout.partition(b"\n")
            if run.returncode != 0 or name.decode().lower() != core.lower():
                continue
            sums = array.array("f", data)
            first = first or sums
            apart = [abs(x - y) for x, y in zip(first, sums) if x != y]
            print(f"{core:12} threads {threads}  {len(apart):7} of {len(sums)} sums differ, "
                  f"by {max(apart, default=0):.1e} at most")


if __name__ == "__main__":
    main()
