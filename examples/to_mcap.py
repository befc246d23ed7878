#!/usr/bin/env python3
"""A recording or a picture log as messages of ROS 2 in an MCAP file, for Foxglove, Rerun, PlotJuggler and ros2 bag:

    examples/to_mcap.py OUT.mcap FILE.safetensors

Its topics are in docs/interoperate.md. A message is logged with the wall-clock time of its frame, as far as the file says
when it began, and published with the sensor's; metadata "supertac" holds the file's (unit, array, size of a pixel).
"""
import json
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import numpy as np  # noqa: E402
import supertac  # noqa: E402

try:
    from mcap_ros2.writer import Writer
except ImportError:
    sys.exit("to_mcap.py: needs the Python package mcap-ros2-support: pip install mcap-ros2-support")

IMAGE = """std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data
{0}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id
{0}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n""".format("=" * 80)
ARRAY = """std_msgs/MultiArrayLayout layout\nfloat32[] data
{0}\nMSG: std_msgs/MultiArrayLayout\nstd_msgs/MultiArrayDimension[] dim\nuint32 data_offset
{0}\nMSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n""".format("=" * 80)


def main(out, path):
    one, dim = supertac.load(path), []
    of = {"rows": 4, "columns": 4, "channels": 1} | json.loads(one.metadata.get("array", "{}"))
    scale = {"pressed": "lower", "range": [2.09, 2.45]} | json.loads(one.metadata.get("signals", "{}"))
    stride = one.volts.shape[1]
    for label in ("rows", "columns", "channels"):
        dim.append({"label": label, "size": of[label], "stride": stride})
        stride //= of[label]
    low, high = scale["range"]
    share = (one.volts - low if scale["pressed"] == "higher" else high - one.volts) / np.float64(high - low)
    force = np.sqrt((share.reshape(len(share), -1, of["channels"])**2).sum(axis=2)) if of["channels"] > 1 else share
    array = one.volts.reshape(-1, of["rows"], of["columns"], of["channels"])
    images = {"picture": getattr(one, "pictures", array), "half_width": getattr(one, "half_widths", None)}
    with open(out, "xb") as file, Writer(file) as writer:
        writer.add_metadata("supertac", one.metadata)
        types = {"Float32MultiArray": ARRAY, "Float32": "float32 data\n", "UInt32": "uint32 data\n"}
        schemas = {name: writer.register_msgdef("std_msgs/msg/" + name, text) for name, text in types.items()}
        schemas["Image"] = writer.register_msgdef("sensor_msgs/msg/Image", IMAGE)
        for i, (time_s, signals) in enumerate(zip(one.time_s, one.volts)):
            wall_ns = round(1e9 * (time_s + float(one.metadata.get("began_s", 0))))

            def write(topic, schema, message):
                writer.write_message("/supertac/" + topic, schemas[schema], message, wall_ns, round(1e9 * time_s), i)
            write("taxels", "Float32MultiArray", {"layout": {"dim": dim, "data_offset": 0}, "data": signals.tolist()})
            write("total_force", "Float32", {"data": force[i].sum()})
            write("saturated", "UInt32", {"data": int((np.abs(share[i]) >= 1).sum())})
            for topic, pictures in images.items():
                if pictures is None:
                    continue
                image = np.ascontiguousarray(pictures[i], "<f4")
                write(topic, "Image", {
                    "header": {"stamp": dict(zip(("sec", "nanosec"), divmod(wall_ns, 10**9))), "frame_id": "supertac"},
                    "height": image.shape[0], "width": image.shape[1], "is_bigendian": 0, "step": image[0].nbytes,
                    "encoding": f"32FC{image[0, 0].size}", "data": image.tobytes()})
    print(f"{out}: {len(one.time_s)} frames")


if __name__ == "__main__":
    main(*sys.argv[1:])
