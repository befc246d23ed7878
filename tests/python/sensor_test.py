#!/usr/bin/env python3
"""A mat on a pseudo-terminal, live in Python: probed, seen, recorded, trained for, drawn. Its order, rest, gain, dead taxels
and clock are applied; what goes wrong is a ValueError.

    tests/python/sensor_test.py BIN [SECONDS of live drawing at 1,008 frames/s with preset paper, 0]

With seconds nothing may be lost, beside one busy core, and the iterator may take 20 us a frame. 77 without NumPy.
"""
import json
import multiprocessing
import os
import pathlib
import sys
import tempfile
import threading
import time
import tty

from ours import np, run, supertac

ORDER = [3, 2, 1, 0, 4, 5, 6, 7, 11, 10, 9, 8]
MAT = {"name": "mat", "rows": 3, "columns": 4, "pitch_mm": 5, "unit": "counts", "pressed": "higher", "range": [40, 900],
       "rate_hz": 100, "frame": {"kind": "text", "separator": ",", "time": {"column": 0, "unit": "ms"}},
       "order": ORDER, "dead": [5], "rest": [50.0] * 12, "gain": [2.0] + [1.0] * 11}


def sent(i):
    """What the device sends as frame i: a taxel after the other is pressed."""
    values = [50] * 12
    values[i // 25 % 12] = 50 + 30 * (i % 25)
    return values


def expected(i):
    values = np.float32([sent(i)[place] for place in ORDER])
    signals = 40 + (values - 50) * np.float32(MAT["gain"])
    around = [1, 4, 6, 9, 0, 2, 8, 10]  # of the dead taxel, in 3x4
    signals[5] = signals[around].mean()
    return signals


class Device(threading.Thread):
    """Sends lines at 100 Hz until it is told to stop, and then hangs up."""

    def __init__(self):
        super().__init__(daemon=True)
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port, self.slave, self.stopped = f"serial:{os.ttyname(slave)}@115200", slave, False
        self.start()

    def run(self):
        begin, i = time.monotonic(), 0
        while not self.stopped:
            line = ",".join(map(str, [10 * i, *sent(i)])) + "\n"
            os.write(self.master, line.encode())
            i += 1
            time.sleep(max(0, begin + i / 100 - time.monotonic()))
        os.close(self.master)

    def hang_up(self):
        self.stopped = True
        self.join()


def refused(work, *words):
    try:
        work()
    except ValueError as error:
        assert all(word in str(error) for word in words), error
        return
    raise AssertionError(f"not refused: {words}")


def check_frames(sensor):
    with sensor.open() as frames:
        seen = [frame for frame, _ in zip(frames, range(150))]
        missing, dropped = frames.lost
    first = round(100 * seen[0].time_s)
    steps = np.diff([frame.time_s for frame in seen])
    assert np.allclose(steps, 0.01, atol=2e-3), steps
    by_value = {tuple(np.round(expected(i)).astype(int)): i for i in range(300)}
    for frame in seen:
        key = tuple(np.round(frame.signals).astype(int))
        assert key in by_value, (first, frame)
        assert np.allclose(frame.signals, expected(by_value[key]), atol=1e-2)
        shares = (frame.signals.astype(float) - 40) / 860
        assert abs(frame.total_force - shares.sum()) < 1e-5 and frame.saturated == (np.abs(shares) >= 1).sum()
    assert max(frame.saturated for frame in seen) <= 1 and dropped == 0 and missing == 0
    refused(lambda: frames.lost, "closed")


def check_ten_lines(folder, sensor):
    """Those of python/README.md; what is trained on is simulated."""
    recording = sensor.record(2)
    (folder / "touched").mkdir()
    supertac.write_recording(folder / "touched/a.safetensors", recording)
    assert 195 <= len(recording.time_s) <= 205 and "in counts" in repr(supertac.load(folder / "touched/a.safetensors"))
    run("supertac-simulate", "--sensor", sensor.path, "--presses", 60, "--out", folder / "pressed", "--quiet")
    supertac.train("frame", folder / "pressed", folder / "mat.safetensors", epochs=1, stride=8, split="none")
    live = supertac.LiveWindow(supertac.load(folder / "mat.safetensors"), sensor.rate_hz)
    pictures = [live.push(frame.time_s, frame.signals) for frame, _ in zip(sensor.open(), range(30))]
    assert all(picture.shape[0] % 3 == 0 and np.isfinite(picture).all() for picture in pictures)


def busy():
    while True:
        pass


def sends(master, seconds):
    """The rig's rate, in a process of its own: 16 numbers a line, with the device's clock."""
    begin, i = time.monotonic(), 0
    while i < 1008 * seconds:
        due = int((time.monotonic() - begin) * 1008) + 1
        os.write(master, "".join(f"{1000 * k / 1008:.3f}," + ",".join(f"{2.4 - 1e-4 * (k % 997):.4f}" for _ in range(16)) + "\n"
                                 for k in range(i, due)).encode())
        i = due
        time.sleep(2e-3)


def check_live(folder, seconds):
    """1,008 frames a second, drawn by preset paper, beside a busy core."""
    rig = {"name": "fast", "rows": 4, "columns": 4, "pitch_mm": 3, "unit": "V", "pressed": "lower", "range": [2.09, 2.45],
           "rate_hz": 1008, "frame": {"kind": "text", "separator": ",", "time": {"column": 0, "unit": "ms"}}}
    (folder / "rig").mkdir()
    run("supertac-simulate", "--out", folder / "rig", "--plates", "6_Ridges", "--passes", 1, "--trials", 1, "--speeds", 10,
        "--quiet")
    supertac.train("paper", folder / "rig", folder / "paper.safetensors", epochs=1, stride=64, split="none")
    model = supertac.load(folder / "paper.safetensors")
    master, slave = os.openpty()
    tty.setraw(slave)
    (folder / "fast.json").write_text(json.dumps({**rig, "port": f"serial:{os.ttyname(slave)}@921600"}))
    frames, live = supertac.Sensor(folder / "fast.json").open(), supertac.LiveWindow(model, 1008)
    others = [multiprocessing.Process(target=busy, daemon=True),
              multiprocessing.Process(target=sends, args=(master, seconds + 2))]
    for process in others:
        process.start()
    count, drawn = 0, 0
    for frame in frames:
        count, drawn = count + 1, drawn + (live.push(frame.time_s, frame.signals) is not None)
        if count >= 1008 * seconds:
            break
    for process in others:
        process.kill()
    missing, dropped = frames.lost
    print(f"{count} frames in {seconds} s, {drawn} pictures, {missing} missing, {dropped} dropped")
    assert missing == 0 and dropped == 0


def check_iterator(folder):
    """Of a file, which waits for nobody: what the iterator takes beyond the reader."""
    lines = "".join(f"{10 * i}," + ",".join(map(str, sent(i))) + "\n" for i in range(20000))
    (folder / "lines.csv").write_text(lines)
    sensor = supertac.Sensor(folder / "mat.json")
    begin = time.process_time()
    count = sum(1 for _ in sensor.open(str(folder / "lines.csv")))
    print(f"{1e6 * (time.process_time() - begin) / count:.1f} us of processor a frame, reading and decoding included")
    assert count == 20000
    return 1e6 * (time.process_time() - begin) / count


def main():
    seconds = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    with tempfile.TemporaryDirectory() as name:
        folder, device = pathlib.Path(name), Device()
        (folder / "mat.json").write_text(json.dumps({**MAT, "port": device.port}))
        sensor = supertac.load(folder / "mat.json")
        assert "'mat': 3x4 taxels, 1 each, in counts, 100 Hz" in repr(sensor), sensor
        said = sensor.probe(2)
        assert said.draft["rows"] == 3 and said.draft["frame"]["kind"] == "text" and any("100" in line for line in said.says), said
        check_frames(sensor)
        check_ten_lines(folder, sensor)
        frames = sensor.open()
        next(frames)
        device.hang_up()
        refused(lambda: list(frames), device.port.split(":")[1].split("@")[0])
        refused(lambda: supertac.Sensor(folder / "none.json"), "none.json")
        (folder / "bad.json").write_text(json.dumps({**MAT, "rows": -1, "port": device.port}))
        refused(lambda: supertac.Sensor(folder / "bad.json"), "bad.json", "rows")
        taken = check_iterator(folder)
        if seconds:
            assert taken <= 20, taken
            check_live(folder, seconds)
    print("live in Python")


if __name__ == "__main__":
    main()
