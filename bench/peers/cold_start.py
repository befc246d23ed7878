#!/usr/bin/python3
"""How long it takes from nothing to the first picture, and how much memory: our code and other engines on one thread.

    bench/peers/cold_start.py NAME=MODEL ... [--bin BUILD/bin] [--starts 31] [--out bench/results/speed/cold_start.csv]

Ours is measured from the start of a program in C to its end, the interpreter's fork included. Other engines have no such program here, so they and our
Python package are measured in a new interpreter each, which has imported them: from the path of the model to the first
picture. Memory is what a process holds at its most (program), or what it holds more than after the import. Engines take
turns. Needs what compare.py needs, and SUPERTAC_LIBRARY for the package.
"""
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

import compare  # restarts with one thread
import engines
import torch

LOAD = {
    "ours, in Python": ("import numpy, supertac", """
picture = supertac.load_model(path).drawer("fp32").draw(window)[0]"""),
    "onnx runtime": ("import numpy, onnxruntime as ort", """
options = ort.SessionOptions()
options.intra_op_num_threads = options.inter_op_num_threads = 1
picture = ort.InferenceSession(path, options, providers=["CPUExecutionProvider"]).run(None, {"windows": window})[0]"""),
    "openvino": ("import numpy, openvino as ov", """
settings = {"INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "INFERENCE_PRECISION_HINT": "f32"}
picture = ov.Core().compile_model(path, "CPU", settings)(window)[0]"""),
    "mnn": ("import numpy, MNN", """
threads = MNN.nn.create_runtime_manager(({"backend": "CPU", "numThread": 1, "precision": "high"},))
network = MNN.nn.load_module_from_file(path, ["windows"], ["pictures"], runtime_manager=threads)
picture = network.forward([MNN.expr.const(window, list(window.shape), MNN.expr.NCHW)])[0].read()"""),
}
CHILD = """
import sys, time
sys.path.insert(0, {package!r})
{imports}
path, window = {path!r}, numpy.zeros({shape}, numpy.float32)
held = lambda: int(open("/proc/self/statm").read().split()[1]) * 4096
before, begin = held(), time.perf_counter()
{load}
print("result", time.perf_counter() - begin, held() - before)
"""


def program(words):
    begin = time.perf_counter()
    told = subprocess.run(words, stdout=subprocess.PIPE, text=True)
    seconds = time.perf_counter() - begin
    if told.returncode != 0:
        sys.exit(f"cold_start.py: this command failed, see above: {' '.join(map(str, words))}")
    return seconds, int(told.stdout.split()[1]) * 1024


def in_python(name, path, shape):
    imports, load = LOAD[name]
    text = CHILD.format(package=str(compare.ROOT / "python"), imports=imports, path=str(path), shape=tuple(shape), load=load)
    told = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
    results = [line.split() for line in told.stdout.splitlines() if line.startswith("result ")]
    if told.returncode != 0 or len(results) != 1:
        sys.exit(f"cold_start.py: {name}: {told.stderr}")
    return float(results[0][1]), int(results[0][2])


def starts(model, windows, folder, binaries):
    """Name -> a call that starts once and tells seconds and bytes."""
    first, shape = pathlib.Path(binaries) / "first_picture", windows.shape
    network = compare.Drawing(model)
    onnx = engines.export_onnx(network, windows, folder)
    found = {"ours, fp32 program": lambda: program([first, model])}
    paths = {"ours, in Python": model, "onnx runtime": onnx, "openvino": onnx}
    if engines.installed("MNN"):
        paths["mnn"] = engines.mnn_file(onnx, windows, folder)
    return found | {name: lambda name=name, path=path: in_python(name, path, shape) for name, path in paths.items()}


def main():
    parser = compare.arguments(__doc__, "cold_start")
    parser.add_argument("models", nargs="+", metavar="NAME=MODEL")
    parser.add_argument("--starts", type=int, default=31)
    options, rows = parser.parse_args(), []
    for name, model in (word.split("=", 1) for word in options.models):
        with tempfile.TemporaryDirectory() as folder, torch.no_grad():
            window = torch.zeros(1, compare.Drawing(model).settings["timesteps"], 16)
            engine, times = starts(model, window, folder, options.bin), {}
            for turn in range(options.starts + 1):  # the first start reads the disk
                for which, start in engine.items():
                    times.setdefault(which, []).append(start())
        for which, all_of in times.items():
            seconds, held = zip(*all_of[1:])
            rows.append({"model": name, "engine": which, "starts": len(seconds), "median_ms": f"{1e3 * statistics.median(seconds):.2f}",
                         "worst_ms": f"{1e3 * max(seconds):.2f}", "memory_mb": f"{statistics.median(held) / 1e6:.1f}"})
            print(*rows[-1].values(), sep=", ", flush=True)
    compare.keep(options.out, rows)


if __name__ == "__main__":
    main()
