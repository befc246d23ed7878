#!/usr/bin/env python3
"""Forwards what supertac-stream draws to Lab Streaming Layer (needs the package pylsl): pictures, or without a model the
array itself. Samples have the frames' own spacing; the first one is stamped when it arrives.

    supertac-stream --board auto --model model.safetensors --out - | examples/lsl_forward.py
    supertac-stream --sensor mat.json --out - | examples/lsl_forward.py
"""

import json
import sys

if sys.argv[1:]:  # it takes none
    print(__doc__)
    sys.exit(0 if sys.argv[1] in ("-h", "--help") else 2)

from pylsl import StreamInfo, StreamOutlet, local_clock  # noqa: E402

outlet, offset, last = None, 0.0, 0.0
for line in sys.stdin:
    seen = json.loads(line)
    values = seen.get("picture") or seen.get("volts") or seen["signals"]
    if outlet is None:
        info = StreamInfo("SuperTac", "tactile", len(values), 0, "float32", "supertac-stream")
        drawn = "picture, rows from the smallest y" if "picture" in seen else "array, row by row, in " + seen["unit"]
        info.desc().append_child_value("content", drawn)
        outlet = StreamOutlet(info)
    if offset == 0.0 or seen["timestamp"] < last:  # a sensor that begins anew
        offset = local_clock() - seen["timestamp"]
    last = seen["timestamp"]
    outlet.push_sample(values, offset + last)
