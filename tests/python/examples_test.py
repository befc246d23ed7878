#!/usr/bin/env python3
"""Every example in Python: at its --help, without a model, and with a mat. What is no package of Debian - pylsl, rclpy,
lerobot - is a stand-in here that prints what it was given; where it is installed tests/python/tools_test.py has the real one.

    tests/python/examples_test.py BIN

77 when NumPy is not installed.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

from ours import ROOT, np, run, supertac

STAND_INS = {
    "pylsl.py": """
import time
class StreamInfo:
    def __init__(self, *words): pass
    def desc(self): return self
    def append_child_value(self, name, value): pass
class StreamOutlet:
    def __init__(self, info): pass
    def push_sample(self, values, timestamp): print(len(values), timestamp)
local_clock = time.monotonic
""",
    "rclpy.py": """
class Node:
    def create_publisher(self, kind, topic, depth): return Publisher(topic)
class Publisher:
    def __init__(self, topic): self.topic = topic
    def publish(self, message): print(self.topic, len(message.data))
def init(): pass
def create_node(name): return Node()
""",
    "std_msgs/msg.py": """
from types import SimpleNamespace
MultiArrayDimension = SimpleNamespace
def Float32MultiArray(data): return SimpleNamespace(data=data, layout=SimpleNamespace(dim=[]))
""",
    "sensor_msgs/msg.py": """
from types import SimpleNamespace
def Image(**fields): return SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace()), **fields)
""",
    "lerobot/datasets/lerobot_dataset.py": """
import json
class LeRobotDataset:
    @classmethod
    def create(cls, name, fps, features, **settings):
        print(json.dumps({key: list(value["shape"]) for key, value in features.items()}))
        return cls()
    def add_frame(self, frame):
        print(json.dumps({key: value if isinstance(value, str) else value.tolist() for key, value in frame.items()}))
    def save_episode(self): pass
    def finalize(self): pass
""",
}


def example(folder, name, *words, given=b"", status=0):
    paths = os.pathsep.join([str(folder / "stand_ins"), str(ROOT / "python")])
    ran = subprocess.run([sys.executable, ROOT / "examples" / name, *map(str, words)], input=given, capture_output=True,
                         env={**os.environ, "PYTHONPATH": paths})
    assert ran.returncode == status, f"{name} {words}: {ran.returncode}\n{ran.stderr.decode()}"
    return ran.stdout.decode()


def helps(folder):
    """The first comment, and nothing is needed for it."""
    for path in sorted((ROOT / "examples").glob("*.py")):
        said = example(folder, path.name, "--help")
        assert said.strip() in path.read_text(), f"{path.name} --help says {said[:60]!r}"


def mat(folder):
    """Half a minute, in which no two frames are the same, of an array of 5x6 taxels in counts at 200 Hz, as --record keeps it."""
    times = np.arange(6000) / 200
    place = np.stack(np.meshgrid(np.arange(5), np.arange(6), indexing="ij"), -1).reshape(-1, 2)
    at = np.stack([2 + 2 * np.sin(times), 2.5 + 2.5 * np.cos(0.7 * times)], 1)
    pressed = np.exp(-((place[None] - at[:, None]) ** 2).sum(2)) * (np.sin(2 * times) > 0)[:, None]
    signals = {"unit": "counts", "pressed": "higher", "range": [40, 900]}
    path = folder / "mat.safetensors"
    supertac.write_recording(path, supertac.Recording(
        times, (40 + 860 * pressed + 0.01 * times[:, None]).astype("f4"), array={"rows": 5, "columns": 6, "pitch_mm": 5, "channels": 1},
        metadata={"signals": json.dumps(signals)}))
    return path


def lines(folder, recording, *words):
    """Those of a stream, drawn and not."""
    return run("supertac-stream", "--recording", recording, *words, "--out", "-", "--quiet", "--seconds", 4)


def check_lines(folder, recording, words, signals, picture):
    given = lines(folder, recording, *words)
    frames = [json.loads(line) for line in given.splitlines()]
    forwarded = np.array([line.split() for line in example(folder, "lsl_forward.py", given=given).splitlines()], float)
    assert (forwarded[:, 0] == (picture or signals)).all() and len(forwarded) == len(frames)
    assert np.allclose(np.diff(forwarded[:, 1]), np.diff([frame["timestamp"] for frame in frames]), atol=1e-6)
    published = example(folder, "ros2_node.py", given=given).split()
    assert published[:2] == ["/supertac/taxels", str(signals)]
    assert published[2:4] == (["/supertac/picture", str(4 * picture)] if picture else published[:2])


def check_episodes(folder, recording):
    """Between two frames of a camera of 30 Hz six or seven frames of the mat come: none is lost, the newest is the last."""
    said = [json.loads(line) for line in example(folder, "to_lerobot.py", folder / "data", 30, recording).splitlines()[:-1]]
    seen = supertac.read_recording(recording)
    assert said[0]["observation.taxels"] == [7, 30], said[0]
    assert len(said) - 1 == round(30 * (seen.time_s[-1] - seen.time_s[6])), len(said)
    ends = np.array([np.flatnonzero((seen.volts == np.float32(frame["observation.taxels"][-1])).all(1))[0] for frame in said[100:150]])
    assert np.abs(np.diff(seen.time_s[ends]) - 1 / 30).max() < 1.01 / 200 and set(np.diff(ends)) <= {6, 7}
    for end, frame in zip(ends, said[100:150]):
        assert np.array_equal(np.float32(frame["observation.taxels"]), seen.volts[end - 6:end + 1])


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for path, text in STAND_INS.items():
            (folder / "stand_ins" / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / "stand_ins" / path).write_text(text)
        helps(folder)
        run("supertac-simulate", "--out", folder / "rig", "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds",
                10, "--quiet")
        rig, model = next((folder / "rig").glob("*.safetensors")), folder / "model.safetensors"
        run("supertac-train", "--data", folder / "rig", "--out", model, "--preset", "tiny", "--split", "none", "--epochs",
                1, "--stride", 48, "--quiet")
        touched = mat(folder)
        check_lines(folder, rig, ["--model", model], 16, 256)
        check_lines(folder, rig, [], 16, 0)
        check_lines(folder, touched, [], 30, 0)
        check_episodes(folder, touched)
        try:
            import matplotlib  # noqa: F401
            assert "drawn" in example(folder, "plot_pass.py", model, rig, folder / "rig.png")
            assert "felt: 16" in example(folder, "plot_pass.py", touched, folder / "mat.png")
            assert all((folder / name).stat().st_size > 10000 for name in ("rig.png", "mat.png"))
        except ImportError:
            print("not plotted: matplotlib is not installed")
        try:
            import h5py
            example(folder, "to_hdf5.py", folder / "all.h5", rig, touched)
            with h5py.File(folder / "all.h5") as file:
                assert file["mat/volts"].shape == (6000, 30)
        except ImportError:
            print("not converted: h5py is not installed")
        example(folder, "tour.py", folder / "rig")
    print("every example runs")


if __name__ == "__main__":
    main()
