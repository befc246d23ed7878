#!/usr/bin/env python3
"""README's way for a sensor of one's own, by its five commands, with devices that know what presses them.

    bench/sensors/own_sensor.py BIN OUT_DIR [--quick] [mat | fingertip | net ...]

Each device is probed, pressed for half a minute and fitted; presses of it are simulated, a network learns them and draws
the device live while one or two discs press it. `mat`: 10x6 taxels at 8 mm over a serial port, with lines at its start,
two dead taxels, a row the wrong way round, a reset and an end of its range; `fingertip`: 3x3 taxels of three axes at 4
mm; `net`: 16x16 at 5 mm in datagrams. Presses, skin and response are written down here, not taken from the simulator.
Prints contact SSIM beside what interpolation has, the share of two discs drawn as two, pictures unlike training and
seconds; exit code 1 where the SSIM is too low or too many pictures are unlike training. `--quick`: fewer presses, epochs.
"""
import json
import os
import pathlib
import pty
import shutil
import socket
import subprocess
import sys
import threading
import time
import tty

try:
    import numpy as np
except ImportError:
    sys.exit(77)  # a test that is left out

BENCH = pathlib.Path(__file__).resolve().parents[1]
sys.path[:0] = [str(BENCH / "sensors"), str(BENCH), str(BENCH.parent / "python")]
import baselines  # noqa: E402
from source import commit_of, keep, source  # noqa: E402
from supertac import read_pictures  # noqa: E402

COLUMNS = ("device", "contact_ssim", "bicubic", "back_projection", "two_as_two", "unlike_training", "pictures", "seconds",
           "processor_s", "command", "commit")
SCALE, MARGIN = 4, 8
BOOT = b"ets Jun  8 2016 00:22:57\r\n\r\nrst:0x1 (POWERON_RESET),boot:0x13\r\nload:0x3fff0030,len:1184\r\nmat v0.3 ready\r\n"


class Device:
    """Sends frames from a thread until it is stopped, and keeps each with the pressure behind it."""

    def __init__(self, seed, rows, columns, pitch, rate, three_axes=False):
        self.rows, self.columns, self.pitch, self.rate, self.three_axes = rows, columns, pitch, rate, three_axes
        same = np.random.default_rng(7)  # every time the same device
        self.rest = same.integers(60, 200, (rows * columns, 3 if three_axes else 1))
        if three_axes:
            self.rest[:, :2] += 1800
        self.gain, self.random = same.normal(1, 0.07, rows * columns), np.random.default_rng(seed)
        self.sigma, self.state, self.scene, self.begin, self.end = 0.55 * pitch, 0, [], 0, 0
        self.y, self.x = ((np.arange(-MARGIN, n * SCALE + MARGIN) + 0.5) / SCALE * pitch - pitch / 2 for n in (rows, columns))
        self.bells = [np.exp(-0.5 * ((cells[None] - np.arange(n)[:, None] * pitch) / self.sigma) ** 2)
                      for cells, n in ((self.y, rows), (self.x, columns))]
        self.bells = [bell / bell.sum(axis=1, keepdims=True) for bell in self.bells]
        self.leans = [bell * (cells[None] - np.arange(n)[:, None] * pitch) / self.sigma
                      for bell, cells, n in zip(self.bells, (self.y, self.x), (rows, columns))]
        self.frames, self.truths, self.discs, self.stopped = [], [], [], False

    def discs_at(self, t):
        """One or two discs of 0.9 to 1.5 pitches, apart, for 0.8 to 2 s; half a second between."""
        if t >= self.end + 0.5:
            self.begin, self.end, self.scene = t, t + self.random.uniform(0.8, 2), []
            for _ in range(self.random.integers(1, 3)):
                for _ in range(100):
                    disc = (*(self.random.uniform(0, (n - 1) * self.pitch) for n in (self.columns, self.rows)),
                            self.random.uniform(0.9, 1.5) * self.pitch, self.random.uniform(0.5, 1))
                    if all(np.hypot(disc[0] - o[0], disc[1] - o[1]) > disc[2] + o[2] + self.pitch for o in self.scene):
                        self.scene.append(disc)
                        break
        return float(np.clip(min((t - self.begin) / 0.25, (self.end - t) / 0.25), 0, 1))

    def frame(self, t):
        depth = self.discs_at(t)
        pressure = np.zeros((len(self.y), len(self.x)))
        for x, y, radius, most in self.scene if depth > 0 else []:
            from_middle = np.hypot(self.y[:, None] - y, self.x[None] - x)
            pressure = np.maximum(pressure, depth * most * np.clip((radius - from_middle) / (0.4 * self.pitch), 0, 1))
        down, across = self.bells
        load = (down @ pressure @ across.T).ravel() * self.gain
        self.state = np.where(load > self.state, load, load + (self.state - load) * np.exp(-1 / (0.04 * self.rate)))
        shown = [1.6 * self.state / (self.state + 0.6)]
        if self.three_axes:
            shown = [(down @ pressure @ self.leans[1].T).ravel(), (self.leans[0] @ pressure @ across.T).ravel(), *shown]
        counts = self.rest + 3600 * np.stack(shown, axis=1) + self.random.normal(0, 12, self.rest.shape)
        counts = np.clip(np.round(counts), 0, 3500).astype(int)
        self.frames.append(counts.ravel())
        self.truths.append(pressure[MARGIN:-MARGIN, MARGIN:-MARGIN].astype(np.float32))
        self.discs.append(len(self.scene) if depth > 0.5 else 0)
        return counts

    def start(self):
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        begin, n = time.monotonic(), 0
        while not self.stopped:
            time.sleep(max(0, begin + n / self.rate - time.monotonic()))
            self.send(n, self.frame(n / self.rate).copy())
            n += 1

    def stop(self):
        self.stopped = True
        self.thread.join()
        self.close()


class Serial(Device):
    """Text on a pseudo-terminal, stamped in ms; starts anew after `reset_s`."""
    dead, backwards = (), None

    def __init__(self, link, seed, *array, reset_s=1e9, **more):
        super().__init__(seed, *array, **more)
        self.main, self.line = pty.openpty()
        tty.setraw(self.line)
        os.set_blocking(self.main, False)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(self.line))
        self.address, self.reset_s, self.born_s = f"serial:{link}@115200", reset_s, 0
        self.write(BOOT)

    def write(self, text):
        try:
            os.write(self.main, text)
        except BlockingIOError:
            pass  # nobody reads

    def send(self, n, counts):
        if n / self.rate > self.reset_s:
            self.reset_s, self.born_s = 1e9, n / self.rate
            self.write(b"1234,5,67," + BOOT)
        counts[list(self.dead)] = self.rest[list(self.dead)]
        if self.backwards is not None:
            row = slice(self.backwards * self.columns, (self.backwards + 1) * self.columns)
            counts[row] = counts[row][::-1]
        self.write((f"{round(1000 * (n / self.rate - self.born_s))}," + ",".join(map(str, counts.ravel()))).encode() + b"\r\n")

    def close(self):
        os.close(self.main)
        os.close(self.line)


class Mat(Serial):
    dead, backwards = (17, 44), 3


class Net(Device):
    """Datagrams of 16-bit numbers behind a header and a time stamp in us."""

    def __init__(self, link, seed, *array, **more):
        super().__init__(seed, *array)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.to = free.getsockname()
        self.address = f"udp::{self.to[1]}"

    def send(self, n, counts):
        stamp = np.uint32(n * 1_000_000 // self.rate).tobytes()
        self.socket.sendto(b"\xaa\x55" + stamp + counts.astype("<u2").tobytes(), self.to)

    def close(self):
        self.socket.close()


# How a device is made, and what its owner writes into the draft, which can only guess.
def order_of_mat():
    order = list(range(60))
    order[18:24] = order[18:24][::-1]
    return order


DEVICES = {"mat": (lambda *a, **m: Mat(*a, 10, 6, 8.0, 50, **m),
                   {"rows": 10, "columns": 6, "pitch_mm": 8, "order": order_of_mat()}),
           "fingertip": (lambda *a, **m: Serial(*a, 3, 3, 4.0, 50, three_axes=True, **m),
                         {"rows": 3, "columns": 3, "channels": 3, "pitch_mm": 4}),
           "net": (lambda *a, **m: Net(*a, 16, 16, 5.0, 50, **m), {"rows": 16, "columns": 16, "pitch_mm": 5})}


def peaks(picture):
    """How many patches stand above a third of the highest."""
    left, count = picture > picture.max() / 3, 0
    while left.any():
        count, stack = count + 1, [tuple(np.argwhere(left)[0])]
        while stack:
            y, x = stack.pop()
            if 0 <= y < left.shape[0] and 0 <= x < left.shape[1] and left[y, x]:
                left[y, x] = False
                stack += [(y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)]
    return count


class Way:
    def __init__(self, programs, folder, name, quick):
        self.programs, self.folder, self.name, self.quick = programs, folder, name, quick
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)

    def run(self, job, *words):
        command = [str(self.programs / f"supertac-{job}"), *map(str, words), "--quiet"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"own_sensor.py: {' '.join(command)}: {done.stdout}{done.stderr}")
        return done.stdout

    def with_device(self, seed, job, *words, **more):
        device = DEVICES[self.name][0](self.folder / "port", seed, **more)
        if (self.folder / "sensor.json").exists():
            self.mend({"port": device.address})
        device.start()
        try:
            self.run(job, *[device.address if word == "ADDRESS" else word for word in words])
        finally:
            device.stop()
        return device

    def mend(self, keys):
        path = self.folder / "sensor.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | keys))

    def go(self):
        begin, before = time.monotonic(), os.times()
        self.with_device(1, "stream", "--sensor", "ADDRESS", "--probe", "--out", "draft.json")
        (self.folder / "draft.json").rename(self.folder / "sensor.json")
        self.mend(DEVICES[self.name][1])
        self.with_device(2, "stream", "--sensor", "sensor.json", "--record", "touched", "--seconds", 30)
        self.run("simulate", "--sensor", "sensor.json", "--fit", "touched", "--presses", 1600 if self.quick else 6000, "--out",
                 "pressed")
        self.run("train", "--data", "pressed", "--preset", "frame", "--split", "group", "--epochs", 4 if self.quick else 6,
                 "--out", "model.safetensors")
        used = os.times()
        live = self.with_device(3, "stream", "--sensor", "sensor.json", "--model", "model.safetensors", "--seconds", 25, "--out",
                                "live.safetensors", "--json", "live.json", reset_s=12)
        return self.score(live) | {"seconds": round(time.monotonic() - begin),
                                   "processor_s": round(used.children_user - before.children_user)}

    def score(self, live):
        log = read_pictures(self.folder / "live.safetensors")
        sensor, told = (json.loads((self.folder / name).read_text()) for name in ("sensor.json", "live.json"))
        place = self.places(sensor, live, log.volts)
        drawn, truth = log.pictures[place >= 0], np.stack(live.truths)[place[place >= 0]]
        discs = np.array(live.discs)[place[place >= 0]]
        channels = sensor.get("channels", 1)
        low, high = sensor["range"]
        taxels = ((log.volts[place >= 0] - low) / (high - low)).reshape(-1, sensor["rows"], sensor["columns"], channels)[..., -1]
        contact, two = np.ptp(truth, axis=(1, 2)) > 0.05, discs == 2
        figures = {"contact_ssim": baselines.ssim(drawn[contact], truth[contact]).mean()}
        for method in (baselines.bicubic, baselines.back_projection):
            figures[method.__name__] = baselines.ssim(method(taxels[contact].clip(0, 1), SCALE), truth[contact]).mean()
        return figures | {"two_as_two": np.mean([peaks(picture) == 2 for picture in drawn[two]]) if two.any() else "",
                          "unlike_training": told["unlike_training"] / told["pictures"], "pictures": told["pictures"]}

    def places(self, sensor, live, signals):
        """For each picture the frame that the device sent, by its numbers, in order; -1: none."""
        sent, channels = np.stack(live.frames).astype(np.float32), sensor.get("channels", 1)
        taxels = sensor["rows"] * sensor["columns"]
        order = sensor.get("order", list(range(taxels)))
        sent = sent.reshape(len(sent), taxels, channels)
        if getattr(live, "backwards", None) is not None:  # the log is in the array's order, frames are not
            row = slice(live.backwards * live.columns, (live.backwards + 1) * live.columns)
            sent[:, row] = sent[:, row][:, ::-1]
        arranged = sent[:, order].reshape(len(sent), -1)
        if "rest" in sensor:
            arranged = arranged - np.float32(sensor["rest"]) + np.float32(sensor["range"][0])
        speaks = np.repeat([k not in sensor.get("dead", []) for k in range(taxels)], channels)
        places, at = [], 0
        for frame in signals:
            off = np.abs(arranged[at:at + 500, speaks] - frame[speaks]).max(axis=1)
            found = np.flatnonzero(off < 0.6)
            places.append(at + found[0] if len(found) else -1)
            at = max(at, places[-1])
        return np.array(places)


def main():
    words = [word for word in sys.argv[1:] if word != "--quick"]
    if len(words) < 2:
        sys.exit(__doc__)
    programs, out, quick = pathlib.Path(words[0]).resolve(), pathlib.Path(words[1]).resolve(), "--quick" in sys.argv
    least = 0.6 if quick else 0.8
    failed = False
    for name in words[2:] or DEVICES:
        figures = Way(programs, out / name, name, quick).go()
        row = {"device": name} | source() | {"commit": commit_of(programs / "supertac-train")[:7]}
        row |= {key: f"{value:.3f}" if isinstance(value, float) else value for key, value in figures.items()}
        print(*(f"{key} {row[key]}" for key in COLUMNS[:-2]), flush=True)
        if not quick:
            keep(BENCH / "results" / "own_sensor.csv", COLUMNS, ("device",), row)
        failed |= not (figures["contact_ssim"] >= least and figures["unlike_training"] <= 0.05)
    sys.exit(failed)


if __name__ == "__main__":
    main()
