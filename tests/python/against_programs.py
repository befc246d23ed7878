#!/usr/bin/env python3
"""What the package in python/ reads and draws, against our programs: windows and pictures of supertac-stream to 1e-5,
for presets tiny and paper and arrays of 4x4 taxels and of 3x5 taxels with two channels. Where PyTorch is installed,
to_torch() likewise; where onnxruntime is, what supertac-export writes.

    tests/python/against_programs.py BIN [WINDOWS of each, 100] [options of supertac-train]

77 when NumPy is not installed.
"""
import dataclasses
import importlib
import json
import multiprocessing
import pathlib
import sys
import tempfile

from ours import LIBRARY, np, run, supertac
from supertac.model import convolve, convolve_transposed


def installed(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"not compared: {name} is not installed")
        return None


torch, onnxruntime = installed("torch"), installed("onnxruntime")
TOLERANCE = 1e-5
WINDOWS = int(sys.argv[2]) if len(sys.argv) > 2 else 100
TRAINING = sys.argv[3:] or ["--epochs", "1", "--stride", "24"]


def with_two_channels(recording, path):
    """A recording of the rig as if by 3x5 taxels with two channels each."""
    volts = np.concatenate([recording.volts, 4.9 - recording.volts[:, :14]], axis=1)
    array = {"rows": 3, "columns": 5, "pitch_mm": 3, "channels": 2}
    tensors = {"time_s": recording.time_s, "volts": volts, "position_mm": recording.position_mm}
    ours = {key: text for key, text in recording.metadata.items() if key not in ("checksum", "supertac_format")}
    supertac.write(path, tensors, ours | {"array": json.dumps(array)})


def check(name, ours, theirs):
    difference = float(np.abs(np.asarray(ours) - theirs).max())
    print(f"{name}: {len(theirs)} within {difference:.1e}")
    return difference <= TOLERANCE


def same_bits(name, ours, theirs):
    print(f"{name}: {len(theirs)}, {'the same bits' if np.array_equal(ours, theirs) else 'OTHER BITS'}")
    return np.array_equal(ours, theirs)


def live_pictures(model, recording):
    live = supertac.LiveWindow(model, 1 / recording.period_s, float(recording.metadata.get("filter_s", 0)))
    drawn = (live.push(*frame) for frame in zip(recording.time_s, recording.volts))
    return np.array([picture for picture in drawn if picture is not None])


def pairs_are_those_of_programs(name, model, data, folder):
    """Of slides: windows and truths of supertac-evaluate, and what is refused."""
    if not LIBRARY.exists():
        return True
    outputs = folder / "pairs.outputs.safetensors"
    run("supertac-evaluate", "--model", model.path, "--data", data, "--split", "none", "--outputs", outputs,
        "--quiet", "--force")
    expected, (windows, truths) = supertac.read(outputs)[0], model.pairs(data)
    try:
        model.pairs(folder / "missing")
        return False
    except ValueError as error:
        assert "missing" in str(error)
    return (same_bits(f"{name}, windows of pairs", windows, expected["input"])
            and same_bits(f"{name}, truths of pairs", truths, expected["truth"]))


def comes_back(name, model, data, folder):
    """Five steps of training in PyTorch, saved: supertac-evaluate draws what the module draws."""
    module, path, outputs = model.to_torch(), folder / "tuned.safetensors", folder / "tuned.outputs.safetensors"
    windows, truths = (torch.tensor(part[:64]) for part in model.pairs(data, 24))
    adam = torch.optim.Adam(module.parameters(), 1e-3)
    for _ in range(5):
        adam.zero_grad()
        ((module.draw(windows).picture - truths) ** 2).mean().backward()
        adam.step()
    supertac.save_model(path, module, model)
    run("supertac-evaluate", "--model", path, "--data", data, "--split", "none", "--limit", 64, "--outputs", outputs,
        "--quiet", "--force")
    tensors = supertac.read(outputs)[0]
    with torch.no_grad():
        drawn = module.draw(torch.tensor(tensors["input"]))
    return check(f"{name}, trained further and saved", drawn.picture, tensors["output"])


def trains(folder, recording):
    """A recording written here, trained by the library and by the program: the same content."""
    if not LIBRARY.exists():
        return True
    data, by_library, by_program = (folder / name for name in ("written", "library.safetensors", "program.safetensors"))
    data.mkdir()
    part = supertac.Recording(recording.time_s, recording.volts, recording.position_mm, metadata={"plate": "6_Ridges"})
    supertac.write_recording(data / "a.safetensors", part)
    losses, settings = [], {"epochs": 2, "stride": 2, "split": "none"}
    assert supertac.train("tiny", data, by_library, lambda step, loss: losses.append(loss), **settings)
    assert not supertac.train("tiny", data, folder / "early", lambda step, loss: step == 2, **settings)
    run("supertac-train", "--data", data, "--out", by_program, "--preset", "tiny", "--quiet",
        *(word for key, value in settings.items() for word in (f"--{key}", value)))
    ours, theirs = (supertac.read(path)[0] for path in (by_library, by_program))
    same = ours.keys() == theirs.keys() and all(np.array_equal(ours[name], theirs[name]) for name in ours)
    print(f"trained in {len(losses)} steps, {'the same bits' if same else 'OTHER BITS'}")
    return same and not (folder / "early").exists() and len(losses) > 2


def refuses_what_programs_refuse(folder, recording):
    """ValueError, and no file."""
    volts = recording.volts.copy()
    volts[3, 2] = np.nan
    bad = ({"volts": volts}, {"volts": recording.volts[:, :15]}, {"time_s": recording.time_s[::-1]}, {"time_s": recording.time_s[1:]},
           {"truth": np.full((len(volts), 2, 2), 1.5)}, {"array": {"rows": 4}},
           {"volts": np.linspace(0, 1, volts.size).reshape(volts.shape),
            "metadata": {"signals": json.dumps({"unit": "counts", "pressed": "higher", "range": [40, 900]})}})
    for change in bad:
        try:
            supertac.write_recording(folder / "bad.safetensors", dataclasses.replace(recording, **change))
        except ValueError:
            continue
        print(f"written: {list(change)}")
        return False
    return not list(folder.glob("bad*"))


def compare(folder, data, preset, recording, path=None):
    name, log = f"{preset} {data.name}", folder / f"{preset}{data.name}.log.safetensors"
    if path is None:
        path = folder / f"{preset}{data.name}.safetensors"
        run("supertac-train", "--data", data, "--out", path, "--preset", preset, "--split", "none", "--quiet",
            *TRAINING)
    run("supertac-stream", "--recording", recording, "--model", path, "--out", log, "--quiet")
    seen, model = supertac.read_pictures(log), supertac.load_model(path)
    times, volts = model.windows(supertac.read_recording(recording))
    if not np.array_equal(times, seen.time_s):
        sys.exit(f"{name}: {len(times)} windows, supertac-stream drew {len(seen.time_s)}")
    some = slice(None, None, max(1, len(times) // WINDOWS))
    drawn = model.draw(volts[some])
    good = check(f"{name}, NumPy", drawn.picture, seen.pictures[some])
    if LIBRARY.exists():
        good &= same_bits(f"{name}, C library", model.draw(volts[some], precision="fp32").picture, seen.pictures[some])
        good &= same_bits(f"{name}, C library live", live_pictures(model, supertac.read_recording(recording)),
                          seen.pictures)
    if torch is not None:
        good &= comes_back(name, model, data, folder)
        module = model.to_torch().eval()
        with torch.no_grad():
            by_torch = module(torch.tensor(volts[some]))
        good &= check(f"{name}, PyTorch", by_torch.picture, seen.pictures[some])
        good &= check(f"{name}, predicted error", by_torch.predicted_error, drawn.predicted_error)
    if onnxruntime is not None:
        run("supertac-export", path, "--onnx", path.with_suffix(".onnx"))
        session = onnxruntime.InferenceSession(str(path.with_suffix(".onnx")), providers=["CPUExecutionProvider"])
        good &= check(f"{name}, onnxruntime", session.run(["picture"], {"volts": volts[some]})[0], seen.pictures[some])
    return good


def check_convolutions():
    """<conv(x), y> = <x, its transpose(y)>, and a sum by hand."""
    random = np.random.default_rng(1)
    x, y = random.normal(size=(2, 3, 8)), random.normal(size=(2, 5, 4))
    weight = random.normal(size=(5, 3, 4))
    one = (convolve(x, weight, 0, 2, 1) * y).sum()
    other = (x * convolve_transposed(y, weight, 0, 2, 1)).sum()
    by_hand = convolve(np.array([[[1.0, 2, 3]]]), np.array([[[1.0, 10, 100]]]), 5)
    return abs(one - other) < 1e-9 and by_hand.tolist() == [[[215, 326, 37]]]


def draws(queue, path, volts):
    queue.put(supertac.load(path).draw(volts, precision="fp32", threads=2).picture)


def works_in_a_fork(model, volts):
    """OpenMP's threads do not survive a fork: a child of a parent that had some draws all the same."""
    if not LIBRARY.exists():
        return True
    ours = model.draw(volts, precision="fp32", threads=2).picture
    for how in ("fork", "spawn"):
        context = multiprocessing.get_context(how)
        queue = context.Queue()
        child = context.Process(target=draws, args=(queue, model.path, volts))
        child.start()
        try:
            theirs = queue.get(timeout=120)
        except Exception:  # noqa: BLE001: nothing came
            child.kill()
            print(f"{how}: the child draws nothing")
            return False
        child.join()
        if not same_bits(f"by a child ({how})", theirs, ours):
            return False
    return True


def clients(model, recording):
    """What is refused as by the programs; empty batches, single windows, what objects say of themselves."""
    volts = model.windows(recording)[1][:40]
    for frames in (0, 1):
        short = dataclasses.replace(recording, time_s=recording.time_s[:frames], volts=recording.volts[:frames])
        assert model.windows(short)[1].shape == (0, *model.window)
    assert model(volts).shape == (40, *model(volts[0]).shape) and model(volts[:0]).shape[0] == 0
    assert " taxels" in repr(model) and f"{len(recording.time_s)} frames" in repr(recording)
    counts = {"signals": json.dumps({"unit": "counts", "pressed": "lower", "range": [0, 900]})}
    for change, words in (({"metadata": counts}, "unit 'counts', the model's 'V'"),
                          ({"metadata": {"filter_s": "0.05"}}, "a moving average of 0.05 s"),
                          ({"array": recording.array | {"rows": 9}}, "taxels with")):
        try:
            model.windows(dataclasses.replace(recording, **change))
            print(f"not refused: {list(change)}")
            return False
        except ValueError as error:
            assert words in str(error), error
    return works_in_a_fork(model, np.concatenate([volts, volts]))


def refuses_damage(path):
    raw = bytearray(path.read_bytes())
    raw[-5] ^= 1
    path.with_suffix(".damaged").write_bytes(raw)
    try:
        supertac.read(path.with_suffix(".damaged"))
    except ValueError as error:
        return "damaged" in str(error)
    return False


def main():
    good = check_convolutions()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        rig, other = folder / "4x4", folder / "3x5x2"
        run("supertac-simulate", "--out", rig, "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds", 5, "--quiet")
        recordings = sorted(rig.glob("*.safetensors"))
        other.mkdir()
        with_two_channels(supertac.read_recording(recordings[0]), other / recordings[0].name)
        for preset in ("tiny", "paper"):
            for data in (rig, other):
                good &= compare(folder, data, preset, data / recordings[0].name)
        raw = folder / "unfiltered"
        run("supertac-simulate", "--out", raw, "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds", 10,
            "--sensor", "rig", "--quiet")
        good &= compare(folder, raw, "tiny", next(raw.glob("*.safetensors")), folder / "tiny4x4.safetensors")
        recording = supertac.read_recording(recordings[0])
        good &= clients(supertac.load(folder / "tiny4x4.safetensors"), recording)
        good &= pairs_are_those_of_programs("tiny", supertac.load(folder / "tiny4x4.safetensors"), rig, folder)
        good &= trains(folder, recording) and refuses_what_programs_refuse(folder, recording)
        good &= refuses_damage(recordings[0])
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
