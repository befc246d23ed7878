#!/usr/bin/env python3
"""What --mcap writes, opened by the public readers (PyPI: mcap, mcap-ros2-support; rosbags has the definitions of the ROS
messages; rerun-sdk): the taxels and pictures of supertac-stream --out, with sizes, times and units. Where h5py and
lerobot are installed, what examples/to_hdf5.py and examples/to_lerobot.py make of the same file.

    tests/python/tools_test.py BIN

77 where a reader is not installed.
"""
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

from ours import BIN, ROOT, np, run, supertac

try:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.typesys import Stores, get_typestore
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

TOPICS = {"/supertac/taxels": "std_msgs/msg/Float32MultiArray", "/supertac/picture": "sensor_msgs/msg/Image",
          "/supertac/half_widths": "sensor_msgs/msg/Image", "/supertac/total_force": "std_msgs/msg/Float32",
          "/supertac/saturated": "std_msgs/msg/UInt32"}
SENSOR = """{"name": "mat", "rows": 2, "columns": 3, "pitch_mm": 5, "channels": 1, "unit": "counts", "pressed": "higher",
"range": [40, 900], "rate_hz": 100, "port": "udp::%d", "frame": {"kind": "text", "separator": ","}}"""


def contents(path):
    """By topic: channel, times of log and publication (s), messages decoded by the file's own definitions."""
    known, found = get_typestore(Stores.ROS2_HUMBLE), {}
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        count = reader.get_summary().statistics.message_count
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            assert schema.name == TOPICS[channel.topic], schema.name
            ours = known.deserialize_cdr(message.data, schema.name)  # by the public definition
            assert known.serialize_cdr(ours, schema.name).tobytes() == message.data, "other bytes than ROS writes"
            found.setdefault(channel.topic, []).append((channel, message.log_time, message.publish_time, decoded))
    assert sum(map(len, found.values())) == count
    return {topic: (rows[0][0], *(np.array([row[i] for row in rows]) / 1e9 for i in (1, 2)), [row[3] for row in rows])
            for topic, rows in found.items()}


def values(image):
    assert image.encoding == "32FC1" and image.step == 4 * image.width and image.header.frame_id == "supertac"
    return np.frombuffer(bytes(image.data), "<f4").reshape(image.height, image.width)


def check_pictures(path, log, array, pixel_mm, began_s):
    found = contents(path)
    assert sorted(found) == sorted(TOPICS), sorted(found)
    share = (2.45 - log.volts) / np.float64(0.36)  # of the rig's range
    for topic, expected in (("total_force", share.sum(axis=1)), ("saturated", (np.abs(share) >= 1).sum(axis=1))):
        found_there = np.array([message.data for message in found["/supertac/" + topic][3]])
        assert np.abs(found_there - expected).max() < 1e-5, topic
    for topic, kept in zip(TOPICS, (log.volts, log.pictures, log.half_widths)):
        channel, logged, published, messages = found[topic]
        assert np.abs(published - log.time_s).max() < 1e-6 and np.abs(logged - published - began_s).max() < 1e-6
        if topic == "/supertac/taxels":
            assert [(d.label, d.size) for d in messages[0].layout.dim] == array
            drawn = [message.data for message in messages]
        else:
            drawn = [values(message) for message in messages]
            stamps = [m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for m in messages]
            assert np.abs(stamps - logged).max() < 1e-6
            assert channel.metadata["pixel_mm"] == pixel_mm
        assert channel.metadata["unit"] == ("V" if topic == "/supertac/taxels" else "1: the highest of the truth")
        assert np.array_equal(np.array(drawn, np.float32), kept), topic
    print(f"{path.name}: {len(log.time_s)} of each topic, the same bits")


def check_rerun(path):
    """Its own checker: indexes, schemas, order of times."""
    if rerun := shutil.which("rerun", path=f"{pathlib.Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"):
        said = subprocess.run([rerun, "mcap", "check", path], capture_output=True, text=True)
        assert said.returncode == 0 and said.stdout.count("ok ") == 5, said.stdout + said.stderr
        print(f"{path.name}: nothing for Rerun to complain of")


def convert(script, *words):
    subprocess.run([sys.executable, ROOT / "examples" / script, *map(str, words)], check=True, stdout=subprocess.DEVNULL,
                   stderr=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": str(ROOT / "python")})


def check_hdf5(folder, log, seen):
    try:
        import h5py
    except ImportError:
        print("not converted: h5py is not installed")
        return
    convert("to_hdf5.py", folder / "all.h5", log)
    with h5py.File(folder / "all.h5") as file:
        assert np.array_equal(file["log/pictures"][:], seen.pictures) and file["log"].attrs["pixel_mm"] == "0.75"
    print(f"all.h5: {len(seen.pictures)} pictures, the same bits")


def check_lerobot(folder, log, seen):
    try:
        from lerobot.datasets.lerobot_dataset import LeRobotDataset
    except ImportError:
        print("not converted: lerobot is not installed")
        return
    convert("to_lerobot.py", folder / "episodes", 50, log, log)
    data = LeRobotDataset("local/tactile", root=folder / "episodes")
    assert data.num_episodes == 2 and data.fps == 50 and len(data) % 2 == 0
    touches = round(1 / 50 / np.median(np.diff(seen.time_s)))
    times, middle = seen.time_s, len(data) // 2
    for i in (0, 7, middle - 1, middle, len(data) - 1):
        frame = data[i]
        newest = np.flatnonzero(times <= times[touches - 1] + frame["frame_index"].item() / 50 + 1e-9)[-1]
        assert np.array_equal(frame["observation.taxels"], seen.volts[newest + 1 - touches:newest + 1])
        assert np.array_equal(frame["observation.picture"], seen.pictures[newest])
    print(f"episodes: {len(data)} frames, the same bits")


def check_live(folder):
    """An array alone, as it comes: the wall clock is that of its arrival."""
    sensor, out = folder / "mat.json", folder / "live.mcap"
    device = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    device.bind(("127.0.0.1", 0))
    port = device.getsockname()[1] % 60000 + 1024  # another than the device's own
    sensor.write_text(SENSOR % port)
    before = time.time()
    program = subprocess.Popen([BIN / "supertac-stream", "--sensor", sensor, "--mcap", out, "--seconds",
                                "2", "--quiet"], stdout=subprocess.DEVNULL)
    while program.poll() is None:
        device.sendto(b"1,2,3,40,50,60", ("127.0.0.1", port))
        time.sleep(0.01)
    assert program.returncode == 0
    found = contents(out)
    channel, logged, _, messages = found["/supertac/taxels"]
    assert channel.metadata["unit"] == "counts" and len(messages) > 10
    assert [(d.label, d.size, d.stride) for d in messages[0].layout.dim] == [("rows", 2, 6), ("columns", 3, 3),
                                                                              ("channels", 1, 1)]
    image = values(found["/supertac/picture"][3][-1])
    assert image.shape == (2, 3) and image[1].tolist() == [40, 50, 60]
    assert before - 1 < logged.min() <= logged.max() < time.time() + 1, (before, logged.min())
    print(f"{out.name}: {len(messages)} frames at {channel.metadata['array']}")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run("supertac-simulate", "--out", folder / "data", "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds",
            10, "--quiet")
        recording, model = next((folder / "data").glob("*.safetensors")), folder / "model.safetensors"
        run("supertac-train", "--data", folder / "data", "--out", model, "--preset", "tiny", "--split", "none", "--epochs",
            1, "--stride", 24, "--quiet")
        log, streamed = folder / "log.safetensors", folder / "streamed.mcap"
        run("supertac-stream", "--recording", recording, "--model", model, "--out", log, "--mcap", streamed, "--quiet")
        seen = supertac.read_pictures(log)
        check_pictures(streamed, seen, [("rows", 4), ("columns", 4), ("channels", 1)], "0.75", 0)
        tensors, metadata = supertac.read(recording)
        kept = {key: text for key, text in metadata.items() if key not in ("checksum", "supertac_format")}
        supertac.write(recording, tensors, kept | {"began_s": "1700000000.5"})
        run("supertac-stream", "--recording", recording, "--model", model, "--mcap", streamed, "--quiet", "--force")
        check_pictures(streamed, seen, [("rows", 4), ("columns", 4), ("channels", 1)], "0.75", 1700000000.5)
        check_live(folder)
        check_rerun(streamed)
        check_hdf5(folder, log, seen)
        check_lerobot(folder, log, seen)


if __name__ == "__main__":
    main()
