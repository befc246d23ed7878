"""What the tests here begin with: NumPy, without which they are left out (exit code 77), the package in python/ and the
library of the build, and the programs in BIN, the first argument."""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(sys.argv[1] if sys.argv[1:] else ROOT / "build/bin")
LIBRARY = BIN.parent / "library/libsupertac.so"
os.environ.setdefault("SUPERTAC_LIBRARY", str(LIBRARY))
sys.path.insert(0, str(ROOT / "python"))
try:
    import numpy as np
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)
import supertac  # noqa: E402

__all__ = ["BIN", "LIBRARY", "ROOT", "np", "run", "supertac"]


def run(program, *words):
    """What one of our programs says; ends the test with its words where it fails."""
    done = subprocess.run([BIN / program, *map(str, words)], capture_output=True)
    if done.returncode != 0:
        sys.exit(done.stderr.decode())
    return done.stdout
