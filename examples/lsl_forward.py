#!/usr/bin/env python3
"""Forwards live pictures to Lab Streaming Layer (needs the package pylsl):

    supertac-stream --board auto --model model.safetensors --out - | examples/lsl_forward.py
"""

import json
import sys

from pylsl import StreamInfo, StreamOutlet

outlet = None
for line in sys.stdin:
    seen = json.loads(line)
    if outlet is None:
        info = StreamInfo("SuperTac", "tactile", len(seen["picture"]), 0, "float32", "supertac-stream")
        info.desc().append_child_value("content", "picture, rows from the smallest y")
        outlet = StreamOutlet(info)
    outlet.push_sample(seen["picture"])
