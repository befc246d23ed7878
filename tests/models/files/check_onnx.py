#!/usr/bin/env python3
"""Compares what onnxruntime draws with what we drew: for each NAME.onnx of a folder, NAME.safetensors has the input and
our outputs under the names of the graph. Prints the largest difference of each; 1 when one exceeds 1e-5, 77 when
onnxruntime is not installed. With the package onnx its checker looks at every file besides.

    tests/models/files/check_onnx.py FOLDER
"""
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "python"))
try:
    import numpy as np
    import onnxruntime
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)
from supertac.files import read  # noqa: E402

TOLERANCE = 1e-5


def check(path):
    tensors, _ = read(path.with_suffix(".safetensors"))
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    inputs = {entry.name: tensors.pop(entry.name) for entry in session.get_inputs()}
    if sorted(names) != sorted(tensors):
        sys.exit(f"{path.name}: the graph has the outputs {names}, we have {list(tensors)}")
    found = dict(zip(names, session.run(names, inputs)))
    differences = {name: float(np.abs(found[name] - tensors[name]).max()) for name in names}
    count = len(next(iter(inputs.values())))
    print(f"{path.name}: {count} inputs, " + ", ".join(f"{name} within {d:.1e}" for name, d in differences.items()))
    return max(differences.values()) <= TOLERANCE


def main():
    paths = sorted(pathlib.Path(sys.argv[1]).glob("*.onnx"))
    try:
        import onnx

        for path in paths:
            onnx.checker.check_model(str(path), full_check=True)
        print(f"onnx {onnx.__version__} accepts {len(paths)} files")
    except ImportError:
        print("onnx is not installed: its checker did not run")
    sys.exit(0 if paths and all([check(path) for path in paths]) else 1)


if __name__ == "__main__":
    main()
