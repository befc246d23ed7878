#!/usr/bin/env python3
"""What examples/to_mcap.py writes, opened by the public readers (PyPI: mcap, mcap-ros2-support; rosbags has the
definitions of the ROS messages; rerun-sdk): the taxels and pictures of supertac-stream --out, with sizes and times. Where
h5py and lerobot are installed, what examples/to_hdf5.py and examples/to_lerobot.py make of the same file.

    tests/python/tools_test.py BIN

77 where a reader is not installed.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

from ours import BIN, ROOT, np, run, supertac

try:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rosbags.typesys import Stores, get_typestore
except ImportError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

TOPICS = {"/supertac/taxels": "std_msgs/msg/Float32MultiArray", "/supertac/picture": "sensor_msgs/msg/Image",
          "/supertac/half_width": "sensor_msgs/msg/Image", "/supertac/total_force": "std_msgs/msg/Float32",
          "/supertac/saturated": "std_msgs/msg/UInt32"}


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


def check_pictures(path, log, array, began_s):
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


def check_array(folder):
    """An array of three axes alone: its picture is the array."""
    path, out = folder / "axes.safetensors", folder / "axes.mcap"
    signals = {"unit": "counts", "pressed": "higher", "range": [0, 100]}
    supertac.write_recording(path, supertac.Recording(
        np.arange(20) / 50, np.arange(360).reshape(20, 18).astype("f4") % 100,
        array={"rows": 2, "columns": 3, "pitch_mm": 5, "channels": 3}, metadata={"signals": json.dumps(signals)}))
    convert("to_mcap.py", out, path)
    found = contents(out)
    layout = found["/supertac/taxels"][3][0].layout
    assert [(d.label, d.size, d.stride) for d in layout.dim] == [("rows", 2, 18), ("columns", 3, 9), ("channels", 3, 3)]
    image = found["/supertac/picture"][3][1]
    assert (image.height, image.width, image.encoding, image.step) == (2, 3, "32FC3", 36)
    assert np.frombuffer(bytes(image.data), "<f4").tolist() == list(range(18, 36))
    force = np.sqrt(((np.arange(18).reshape(6, 3) / 100) ** 2).sum(axis=1)).sum()
    assert abs(found["/supertac/total_force"][3][0].data - force) < 1e-6 and "/supertac/half_width" not in found
    print(f"{out.name}: {len(found['/supertac/taxels'][3])} frames of three axes")


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run("supertac-simulate", "--out", folder / "data", "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds",
            10, "--quiet")
        recording, model = next((folder / "data").glob("*.safetensors")), folder / "model.safetensors"
        run("supertac-train", "--data", folder / "data", "--out", model, "--preset", "tiny", "--split", "none", "--epochs",
            1, "--stride", 24, "--quiet")
        log, converted = folder / "log.safetensors", folder / "log.mcap"
        run("supertac-stream", "--recording", recording, "--model", model, "--out", log, "--quiet")
        seen = supertac.read_pictures(log)
        convert("to_mcap.py", converted, log)
        check_pictures(converted, seen, [("rows", 4), ("columns", 4), ("channels", 1)], 0)
        tensors, metadata = supertac.read(log)
        kept = {key: text for key, text in metadata.items() if key not in ("checksum", "supertac_format")}
        supertac.write(log, tensors, kept | {"began_s": "1700000000.5"})
        converted.unlink()
        convert("to_mcap.py", converted, log)
        check_pictures(converted, seen, [("rows", 4), ("columns", 4), ("channels", 1)], 1700000000.5)
        check_array(folder)
        check_rerun(converted)
        check_hdf5(folder, log, seen)
        check_lerobot(folder, log, seen)


if __name__ == "__main__":
    main()
