#!/usr/bin/env python3
"""Recordings and picture logs as a data set of LeRobot (needs the packages supertac, from ../python, and lerobot):

    examples/to_lerobot.py OUT_DIR FPS FILE.safetensors ...

Each file is an episode, its plate the task. Frames are those nearest to every 1/FPS s: observation.taxels [signals] in
the unit of the file, and what all files have of observation.position_mm [2] and observation.picture [height,width].
"""
import pathlib
import sys

import numpy as np
import supertac
from lerobot.datasets.lerobot_dataset import LeRobotDataset

NAMES = {"volts": "observation.taxels", "position_mm": "observation.position_mm", "pictures": "observation.picture"}


def main(out, fps, *files):
    episodes = [supertac.read(path) for path in map(pathlib.Path, files)]
    common = [name for name in NAMES if all(name in tensors for tensors, _ in episodes)]
    features = {NAMES[name]: {"dtype": "float32", "shape": episodes[0][0][name].shape[1:], "names": None} for name in common}
    data = LeRobotDataset.create("local/tactile", int(fps), features, root=out, robot_type="supertac", use_videos=False)
    for tensors, metadata in episodes:
        times = tensors["time_s"]
        wanted = np.arange(times[0], times[-1], 1 / int(fps))
        after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
        nearest = after - (wanted - times[after - 1] < times[after] - wanted)
        for i in nearest:
            data.add_frame({NAMES[name]: np.ascontiguousarray(tensors[name][i], "f4") for name in common}
                           | {"task": "feel " + metadata.get("plate", "a surface")})
        data.save_episode()
    data.finalize()
    print(f"{out}: {len(episodes)} episodes of {', '.join(NAMES[name] for name in common)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
