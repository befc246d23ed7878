"""The engines that users would pick: name -> a call that draws a batch on one thread. Those that are not installed are
skipped with one line each."""
import importlib
import importlib.metadata
import pathlib
import subprocess
import sys

import torch


def installed(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name} is not installed and not compared (bench/peers/requirements.txt)")
        return None


def versions():
    names = ("torch", "onnxruntime", "openvino", "nncf", "MNN")
    return {name.lower(): importlib.metadata.version(name).split("+")[0] for name in names if installed(name)}


def export_onnx(model, windows, folder):
    path = pathlib.Path(folder) / f"batch{len(windows)}.onnx"
    torch.onnx.export(model, (windows,), str(path), input_names=["windows"], output_names=["pictures"], dynamo=False,
                      opset_version=17)
    return path


def pytorch(model, windows, compiled_too):
    calls = {"pytorch eager": lambda: model(windows)}
    if compiled_too:
        compiled = torch.compile(model)
        compiled(windows)
        calls["torch.compile"] = lambda: compiled(windows)
    return calls


def onnx_runtime(path, windows, calibration, folder):
    ort = installed("onnxruntime")
    if ort is None:
        return {}
    from onnxruntime import quantization

    class Reader(quantization.CalibrationDataReader):
        def __init__(self):
            self.rest = iter({"windows": part} for part in calibration.split(len(windows)))

        def get_next(self):
            part = next(self.rest, None)
            return None if part is None or len(part["windows"]) < len(windows) else {"windows": part["windows"].numpy()}

    int8 = str(pathlib.Path(folder) / "int8.onnx")
    quantization.quantize_static(str(path), int8, Reader(), per_channel=True)
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    array, calls = windows.numpy(), {}
    for name, file in (("onnx runtime", str(path)), ("onnx runtime int8", int8)):
        session = ort.InferenceSession(file, options, providers=["CPUExecutionProvider"])
        calls[name] = lambda session=session: session.run(None, {"windows": array})[0]
    return calls


def open_vino(path, windows, calibration):
    ov, nncf = installed("openvino"), installed("nncf")
    if ov is None:
        return {}
    core, array, calls = ov.Core(), windows.numpy(), {}
    network = core.read_model(path)
    kinds = [("openvino", network, "f32"), ("openvino bf16", network, "bf16")]
    if nncf is not None:
        parts = [part.numpy() for part in calibration.split(len(windows)) if len(part) == len(windows)]
        kinds.append(("openvino int8", nncf.quantize(core.read_model(path), nncf.Dataset(parts)), "f32"))
    for name, kind, precision in kinds:
        settings = {"INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "INFERENCE_PRECISION_HINT": precision}
        request = core.compile_model(kind, "CPU", settings).create_infer_request()
        request.set_input_tensor(ov.Tensor(array, shared_memory=True))

        def call(request=request):
            request.infer()
            return request.get_output_tensor().data

        calls[name] = call
    return calls


def mnn_file(path, windows, folder):
    """The ONNX file in MNN's own form."""
    beside, converted = pathlib.Path(sys.executable).with_name("mnnconvert"), pathlib.Path(folder) / f"batch{len(windows)}.mnn"
    words = ["-f", "ONNX", "--modelFile", path, "--MNNModel", converted, "--bizCode", "supertac"]
    subprocess.run([beside if beside.exists() else "mnnconvert", *map(str, words)], check=True, capture_output=True)
    return converted


def mnn(path, windows, folder):
    module = installed("MNN")
    if module is None:
        return {}
    threads = module.nn.create_runtime_manager(({"backend": "CPU", "numThread": 1, "precision": "high"},))
    converted = str(mnn_file(path, windows, folder))
    network = module.nn.load_module_from_file(converted, ["windows"], ["pictures"], runtime_manager=threads)
    array = module.expr.const(windows.numpy(), list(windows.shape), module.expr.NCHW)
    return {"mnn": lambda: network.forward([array])[0].read()}


def inference(model, windows, calibration, folder, compiled_too):
    """All of them for one batch; `calibration` are windows for the quantisers."""
    calls = pytorch(model, windows, compiled_too)
    if installed("onnx") is None:
        return calls
    path = export_onnx(model, windows, folder)
    return (calls | onnx_runtime(path, windows, calibration, folder) | open_vino(path, windows, calibration)
            | mnn(path, windows, folder))
