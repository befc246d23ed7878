"""The engines that users would pick: name -> a call that draws a batch on one thread. Those that are not installed are
skipped with one line each."""
import importlib
import importlib.metadata
import os
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
    names = ("torch", "onnxruntime", "openvino", "MNN", "ncnn", "executorch", "ai_edge_litert")
    return " ".join(f"{name.lower()} {importlib.metadata.version(name).split('+')[0]}" for name in names if installed(name))


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


def onnx_runtime(path, windows):
    ort = installed("onnxruntime")
    if ort is None:
        return {}
    options = ort.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session, array = ort.InferenceSession(str(path), options, providers=["CPUExecutionProvider"]), windows.numpy()
    return {"onnx runtime": lambda: session.run(None, {"windows": array})[0]}


def open_vino(path, windows):
    ov = installed("openvino")
    if ov is None:
        return {}
    core, array = ov.Core(), windows.numpy()
    settings = {"INFERENCE_NUM_THREADS": 1, "NUM_STREAMS": 1, "INFERENCE_PRECISION_HINT": "f32"}
    request = core.compile_model(core.read_model(path), "CPU", settings).create_infer_request()
    request.set_input_tensor(ov.Tensor(array, shared_memory=True))

    def call():
        request.infer()
        return request.get_output_tensor().data

    return {"openvino": call}


def convert(program, *words):
    """Runs an engine's converter, the one beside this Python before any other. MNN's would install a package on the way."""
    beside = pathlib.Path(sys.executable).with_name(program)
    subprocess.run([beside if beside.exists() else program, *map(str, words)], check=True, capture_output=True,
                   env=os.environ | {"PIP_NO_INDEX": "1"})


def mnn_file(path, windows, folder):
    """The ONNX file in MNN's own form."""
    converted = pathlib.Path(folder) / f"batch{len(windows)}.mnn"
    convert("mnnconvert", "-f", "ONNX", "--modelFile", path, "--MNNModel", converted, "--bizCode", "supertac")
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


def ncnn_file(model, windows, folder):
    """The network in ncnn's own form, without the ending. ncnn takes slices of a row of numbers, but no list of places."""
    path, network = pathlib.Path(folder) / f"ncnn{len(windows)}", model.network
    groups = network.groups
    network.groups = [slice(int(group[0]), int(group[-1]) + 1) for group in groups]
    torch.jit.trace(model, (windows,)).save(f"{path}.pt")
    network.groups = groups
    convert("pnnx", f"{path}.pt", f"inputshape={list(windows.shape)}f32".replace(" ", ""), "fp16=0")
    return f"{path}.ncnn"


def ncnn(model, windows, folder):
    module = installed("ncnn") if installed("pnnx") else None
    if module is None:
        return {}
    if any(int(group[-1]) - int(group[0]) != len(group) - 1 for group in model.network.groups):
        print("ncnn cannot pick the signals of these groups and is not compared")
        return {}
    network, array = module.Net(), windows.numpy()
    network.opt.num_threads = 1
    for name in ("use_fp16_packed", "use_fp16_storage", "use_fp16_arithmetic"):
        setattr(network.opt, name, False)
    converted = ncnn_file(model, windows, folder)
    network.load_param(f"{converted}.param")
    network.load_model(f"{converted}.bin")

    def call():
        run = network.create_extractor()
        run.input("in0", module.Mat(array, batch_index=0))
        return run.extract("out0")[1].numpy(batch_index=0)

    return {"ncnn": call}


def execu_torch(program, windows):
    if installed("executorch") is None:
        return {}
    from executorch.backends.xnnpack.partition.xnnpack_partitioner import XnnpackPartitioner
    from executorch.exir import to_edge_transform_and_lower
    from executorch.extension.pybindings import portable_lib
    from executorch.runtime import Runtime

    portable_lib._unsafe_reset_threadpool(1)
    file = to_edge_transform_and_lower(program, partitioner=[XnnpackPartitioner()]).to_executorch().buffer
    loaded = Runtime.get().load_program(file)
    method = loaded.load_method("forward")
    # Nothing else keeps the file, which the method goes on reading.
    return {"executorch": lambda kept=(file, loaded): method.execute([windows])[0]}


TO_LITERT = """import sys, torch, litert_torch
program = torch.export.load(sys.argv[1])
litert_torch.convert(program.module(), program.example_inputs[0]).export(sys.argv[2])
"""


def litert(program, windows, folder):
    """Its converter wants another PyTorch: LITERT_PYTHON is the python of an environment with litert-torch."""
    if installed("ai_edge_litert") is None:
        return {}
    if "LITERT_PYTHON" not in os.environ:
        print("LITERT_PYTHON is not set and litert not compared (bench/peers/requirements.txt)")
        return {}
    from ai_edge_litert.interpreter import Interpreter

    saved, converted = (str(pathlib.Path(folder) / f"batch{len(windows)}.{ending}") for ending in ("pt2", "tflite"))
    torch.export.save(program, saved)
    subprocess.run([os.environ["LITERT_PYTHON"], "-c", TO_LITERT, saved, converted], check=True, capture_output=True)
    network, array = Interpreter(converted, num_threads=1), windows.numpy()
    network.allocate_tensors()
    takes, gives = network.get_input_details()[0]["index"], network.get_output_details()[0]["index"]

    def call():
        network.set_tensor(takes, array)
        network.invoke()
        return network.get_tensor(gives)

    return {"litert": call}


def inference(model, windows, folder, compiled_too):
    """All of them for one batch."""
    calls = pytorch(model, windows, compiled_too) | ncnn(model, windows, folder)
    program = torch.export.export(model, (windows,))
    calls |= execu_torch(program, windows) | litert(program, windows, folder)
    if installed("onnx") is None:
        return calls
    path = export_onnx(model, windows, folder)
    return calls | onnx_runtime(path, windows) | open_vino(path, windows) | mnn(path, windows, folder)
