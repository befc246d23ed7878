#!/usr/bin/env python3
"""Recordings and picture logs as a data set of LeRobot (needs the packages supertac, from ../python, and lerobot):

    examples/to_lerobot.py OUT_DIR FPS FILE.safetensors ...

Each file is an episode, its plate the task, and a frame stands every 1/FPS s, as those of a camera do. Touch is faster:
observation.taxels [K,signals], in the unit of the file, are the K newest frames at that time, oldest first, K as many as
come in 1/FPS s; observation.position_mm [2] and observation.picture [height,width], of what all files have, are the
newest.
"""
import sys

if sys.argv[1:] in ([], ["-h"], ["--help"]):
    print(__doc__)
    sys.exit(0 if sys.argv[1:] else 2)

import numpy as np  # noqa: E402
import supertac  # noqa: E402
from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402

NAMES = {"volts": "observation.taxels", "position_mm": "observation.position_mm", "pictures": "observation.picture"}


def main(out, fps, *files):
    episodes = [vars(supertac.load(path)) for path in files]
    common = [name for name in NAMES if all(one.get(name) is not None for one in episodes)]
    period_s = np.median(np.concatenate([np.diff(one["time_s"]) for one in episodes]))
    between = np.arange(1 - max(1, round(1 / float(fps) / period_s)), 1)  # frames of touch up to the newest
    shapes = {name: episodes[0][name].shape[1:] for name in common}
    shapes["volts"] = (len(between), *shapes["volts"])
    features = {NAMES[name]: {"dtype": "float32", "shape": shapes[name], "names": None} for name in common}
    data = LeRobotDataset.create("local/tactile", int(fps), features, root=out, robot_type="supertac", use_videos=False)
    for one in episodes:
        times = one["time_s"]
        first = times[len(between) - 1]
        newest = np.searchsorted(times, np.arange(first, times[-1], 1 / float(fps)) + 1e-6 * period_s, "right") - 1
        for i in newest:
            rows = {name: one[name][i + between if name == "volts" else i] for name in common}
            data.add_frame({NAMES[name]: np.ascontiguousarray(row, "f4") for name, row in rows.items()}
                           | {"task": "feel " + one["metadata"].get("plate", "a surface")})
        data.save_episode()
    data.finalize()
    print(f"{out}: {len(episodes)} episodes of {', '.join(NAMES[name] for name in common)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
