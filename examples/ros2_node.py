#!/usr/bin/env python3
"""A ROS 2 node that publishes live pictures and taxels; run it where ROS 2 has been sourced:

    supertac-stream --sensor mat.json --model model.safetensors --out - | examples/ros2_node.py

The topics and messages are those of supertac-stream --mcap, whose file `ros2 bag play` replays without this node.
"""
import array
import json
import sys

if sys.argv[1:2] in (["-h"], ["--help"]):
    print(__doc__)
    sys.exit()

import rclpy  # noqa: E402
from sensor_msgs.msg import Image  # noqa: E402
from std_msgs.msg import Float32MultiArray, MultiArrayDimension  # noqa: E402


def main():
    rclpy.init()
    node = rclpy.create_node("supertac")
    pictures = node.create_publisher(Image, "/supertac/picture", 10)
    taxels = node.create_publisher(Float32MultiArray, "/supertac/taxels", 10)
    for line in sys.stdin:
        seen = json.loads(line)
        signals = seen.get("volts") or seen["signals"]
        felt, stride = Float32MultiArray(data=signals), len(signals)
        for label in ("rows", "columns", "channels"):
            felt.layout.dim.append(MultiArrayDimension(label=label, size=seen[label], stride=stride))
            stride //= seen[label]
        taxels.publish(felt)
        if "picture" in seen:
            image = Image(height=seen["height"], width=seen["width"], encoding="32FC1", step=4 * seen["width"],
                          data=array.array("B", array.array("f", seen["picture"]).tobytes()))
            image.header.frame_id = "supertac"
            seconds = seen.get("wall_s", seen["timestamp"])
            image.header.stamp.sec, image.header.stamp.nanosec = divmod(round(1e9 * seconds), 10**9)
            pictures.publish(image)


if __name__ == "__main__":
    main()
