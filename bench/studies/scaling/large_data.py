#!/usr/bin/env python3
"""Training on data larger than memory: large_data.py BIN_DIR OUT_CSV SECONDS FOLDER... [-- OPTIONS].

OPTIONS are those of supertac-train. On every folder of recordings one training runs for SECONDS. Start is the time
until the first step may begin, tracks the bytes of its temporary file (in TMPDIR), peak the most memory the process
held, and CPU the processor's time for one step. With LIMIT=1G in the environment it runs in a memory cgroup of that
size, which counts the system's cache of files too. The smallest folder is what the others are compared with.
"""
import csv
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2]))
from source import source  # noqa: E402

COLUMNS = ["frames", "recordings", "tracks_mb", "limit", "start_s", "start_cpu_s", "peak_mb", "steps", "ms_per_step",
           "cpu_ms_per_step"]


class Training:
    def __init__(self, train, folder, out, options, limit=None):
        self.run = os.path.splitext(out)[0] + ".run"
        self.begin = time.monotonic()
        words = [train, "--data", folder, "--out", out, "--force", "--checkpoint-every", "1000000000", *options]

        def enter():
            if limit:
                with open(os.path.join(limit, "cgroup.procs"), "w") as group:
                    group.write("0")

        self.process = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
                                        preexec_fn=enter)
        lines = []
        for line in self.process.stderr:
            lines.append(line)
            if "training on" in line:
                break
        else:
            raise SystemExit("".join(lines))
        self.start_s = time.monotonic() - self.begin
        self.start_cpu_s = self.cpu_s()

    def cpu_s(self):
        with open(f"/proc/{self.process.pid}/stat") as stat:
            fields = stat.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def peak_mb(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            return next(int(line.split()[1]) / 1000 for line in status if line.startswith("VmHWM"))

    def log(self):
        with open(os.path.join(self.run, "log.csv")) as file:
            rows = [row for row in csv.DictReader(file) if row["test_psnr_db"] is not None]  # complete ones
            return [(float(row["time_s"]), int(row["step"])) for row in rows]

    def tracks_mb(self):
        files = f"/proc/{self.process.pid}/fd"
        sizes = [os.stat(os.path.join(files, name)).st_size for name in os.listdir(files)
                 if "/.supertac-" in os.readlink(os.path.join(files, name))]
        return round(sum(sizes) / 1e6)

    def end(self):
        peak, log = self.peak_mb(), self.log()
        self.process.send_signal(signal.SIGTERM)
        self.process.stderr.read()
        self.process.wait()
        return peak, log


def memory_cgroup():
    if "LIMIT" not in os.environ:
        return None
    group = "/sys/fs/cgroup/memory/large_data"
    os.makedirs(group, exist_ok=True)
    with open(os.path.join(group, "memory.limit_in_bytes"), "w") as file:
        file.write(os.environ["LIMIT"])
    return group


def measure(train, folder, seconds, options, scratch):
    training = Training(train, folder, os.path.join(scratch, "model.safetensors"), options, memory_cgroup())
    tracks, seen = training.tracks_mb(), []  # (step, seconds of the processor) at each new line of the log
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.1)
        log = training.log()
        if log and (not seen or log[-1][1] > seen[-1][0]):
            seen.append((log[-1][1], training.cpu_s()))
    peak, log = training.end()
    (first, cpu_first), (last, cpu_last) = seen[0], seen[-1]
    times = [time for time, step in log if first <= step <= last]
    steps = max(last - first, 1)
    with open(os.path.join(training.run, "settings.json")) as file:
        counts = re.search(r"from (\d+) frames of (\d+) recordings", json.load(file)["windows"])
    return {"frames": counts[1], "recordings": counts[2], "tracks_mb": tracks, "limit": os.environ.get("LIMIT", ""),
            "start_s": f"{training.start_s:.2f}", "start_cpu_s": f"{training.start_cpu_s:.2f}", "peak_mb": f"{peak:.0f}",
            "steps": steps, "ms_per_step": f"{1e3 * (times[-1] - times[0]) / steps:.1f}",
            "cpu_ms_per_step": f"{1e3 * (cpu_last - cpu_first) / steps:.1f}"}


def main():
    words, options = sys.argv[1:], []
    if "--" in words:
        options = words[words.index("--") + 1:]
        words = words[:words.index("--")]
    bin_dir, table, seconds, *folders = words
    scratch = table + ".runs"
    os.makedirs(scratch, exist_ok=True)
    with open(table, "w") as file:
        writer = csv.DictWriter(file, [*COLUMNS, *source()])
        writer.writeheader()
        for folder in folders:
            train = os.path.join(bin_dir, "supertac-train")
            line = measure(train, folder, float(seconds), options, scratch)
            writer.writerow(line | source())
            file.flush()
            print(line, flush=True)
    shutil.rmtree(scratch)


if __name__ == "__main__":
    main()
