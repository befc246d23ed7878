#!/usr/bin/env python3
"""Streams two fast arrays for minutes: 16x16 taxels at 1,000 Hz over UDP, 32x64 at 200 Hz over a serial port.

  endurance.py STREAM [SECONDS]

STREAM is the program supertac-stream. Frames are made here, at their times; what the program sends on for each is
received here, so a time goes from before a frame is sent until after its raw picture has come. Every hundredth picture
is compared with its frame. Keeps a line for each array in bench/results/reliability/sensors.csv.
"""
import binascii
import json
import os
import pathlib
import pty
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty

import numpy as np

BENCH = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(BENCH))
from source import commit_of, keep  # noqa: E402

KEPT = BENCH / "results" / "reliability" / "sensors.csv"
COLUMNS = ("array", "port", "rate_hz", "seconds", "sent", "read", "said_lost", "shown", "unequal", "median_ms", "p99_ms", "max_ms",
           "grown_kb", "command", "commit")
HEADER = b"\xaa\x55\x5a\xa5"


def frame(number, taxels):
    """Each differs from those around it in every taxel."""
    return ((np.arange(taxels) * 7 + number * 13) % 4001).astype("<u2")


class Device:
    """Sends frames of so many taxels; `send` hands over the bytes of one."""
    def __init__(self, rows, columns, rate_hz):
        self.rows, self.columns, self.rate_hz = rows, columns, rate_hz
        self.sent_s = []

    def describe(self, port):
        return {"name": "endurance", "rows": self.rows, "columns": self.columns, "pitch_mm": 2, "unit": "counts",
                "pressed": "higher", "range": [0, 4000], "rate_hz": self.rate_hz, "port": port,
                "frame": {"kind": "binary", "header": HEADER.hex(), "type": "u16", "endian": "little",
                          "time": {"type": "u32", "unit": "us"}, "checksum": "crc16-ccitt"}}

    def bytes_of(self, number):
        body = np.uint32(number * 1_000_000 // self.rate_hz % 2**32).tobytes() + frame(number, self.rows * self.columns).tobytes()
        return HEADER + body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "little")

    def run(self, send, seconds):
        begin = time.monotonic()
        for number in range(int(seconds * self.rate_hz)):
            due = begin + number / self.rate_hz
            bytes_ = self.bytes_of(number)
            time.sleep(max(0.0, due - time.monotonic()))
            self.sent_s.append(time.monotonic())
            send(bytes_)


class Pictures(threading.Thread):
    """Takes the lines: of each its number and time, of every hundredth also what it shows."""
    def __init__(self, lines):
        super().__init__(daemon=True)
        self.lines, self.came = lines, {}
        self.start()

    def run(self):
        for line in self.lines:
            now = time.monotonic()
            number = int(re.search(rb'"number":(\d+)', line[:400])[1])
            self.came[number] = (now, line if number % 100 == 0 else None)


def resident_kb(pid):
    return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{pid}/status").read_text())[1])


def study(stream, device, kind, seconds, folder):
    udp = kind == "udp"
    if udp:
        taken = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        taken.bind(("127.0.0.1", 0))
        number = taken.getsockname()[1]
        taken.close()
        port, out = f"udp:127.0.0.1:{number}", socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        send = lambda data: out.sendto(data, ("127.0.0.1", number))
    else:
        out, slave = pty.openpty()
        tty.setraw(slave)
        port = f"serial:{os.ttyname(slave)}@12000000"

        def send(data):
            while data:
                data = data[os.write(out, data):]
    sensor = folder / f"{kind}.json"
    sensor.write_text(json.dumps(device.describe(port)))
    told = folder / f"{kind}_told.json"
    program = subprocess.Popen([stream, "--sensor", sensor, "--out", "-", "--json", told, "--quiet"], stdout=subprocess.PIPE)
    pictures = Pictures(program.stdout)
    time.sleep(1)
    sender = threading.Thread(target=device.run, args=(send, seconds))
    sender.start()
    time.sleep(min(30, seconds / 2))
    before = resident_kb(program.pid)
    sender.join()
    after = resident_kb(program.pid)
    time.sleep(1)
    program.send_signal(signal.SIGINT)
    program.wait(20)
    result = json.loads(told.read_text())
    late = [1e3 * (pictures.came[n][0] - s) for n, s in enumerate(device.sent_s) if n in pictures.came]
    unequal = 0
    for number, (_, line) in pictures.came.items():
        if line:
            shown = np.array(json.loads(line)["volts"])
            unequal += not np.array_equal(shown.ravel(), frame(number, device.rows * device.columns))
    return {"array": f"{device.rows}x{device.columns}", "port": kind, "rate_hz": device.rate_hz, "seconds": seconds,
            "sent": len(device.sent_s), "read": result["frames"], "said_lost": result["lost"] + result["dropped"],
            "shown": len(pictures.came), "unequal": unequal, "median_ms": round(float(np.median(late)), 2),
            "p99_ms": round(float(np.quantile(late, 0.99)), 2), "max_ms": round(max(late), 2), "grown_kb": after - before}


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    stream, seconds = sys.argv[1], float(sys.argv[2]) if len(sys.argv) == 3 else 600
    for kind, device in ("udp", Device(16, 16, 1000)), ("serial", Device(32, 64, 200)):
        with tempfile.TemporaryDirectory() as folder:
            row = study(stream, device, kind, seconds, pathlib.Path(folder))
        row |= {"command": "bench/sensors/endurance.py STREAM", "commit": commit_of(stream)}
        print(*row.values(), flush=True)
        keep(KEPT, COLUMNS, ("port",), row)


if __name__ == "__main__":
    main()
