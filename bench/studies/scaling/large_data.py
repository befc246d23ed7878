#!/usr/bin/env python3
"""Training on data larger than memory: large_data.py BIN_DIR OUT_CSV MEMORY SECONDS FOLDER... [-- OPTIONS].

OPTIONS are those of supertac-train.

Of every folder of recordings three trainings are measured: with --memory for the first time (FOLDER/.supertac is
removed before), with all recordings held in memory, and with --memory again. The last two train side by side for
SECONDS, so that whatever else the machine does slows both alike. Start is the time until the first step may begin,
peak the most memory a process held, and CPU the processor's time for one step. With LIMIT=1G in the environment the
second training with --memory runs in a memory cgroup of that size, which counts the system's cache of files too.
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

COLUMNS = ["frames", "recordings", "tracks_mb", "mode", "memory", "start_s", "start_cpu_s", "peak_mb", "steps",
           "ms_per_step", "cpu_ms_per_step"]


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
        self.memory = options[options.index("--memory") + 1] if "--memory" in options else "all"

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

    def send(self, number):
        self.process.send_signal(number)

    def end(self):
        peak, log = self.peak_mb(), self.log()
        self.send(signal.SIGTERM)
        self.process.stderr.read()
        self.process.wait()
        return peak, log


def row(folder, mode, training, peak, log, cpu):
    with open(os.path.join(training.run, "settings.json")) as file:
        counts = re.search(r"from (\d+) frames of (\d+) recordings", json.load(file)["windows"])
    kept = os.path.join(folder, ".supertac")
    tracks = sum(os.path.getsize(os.path.join(kept, name)) for name in os.listdir(kept) if name.endswith(".f32"))
    timed = len(log) > 1
    return {"frames": counts[1], "recordings": counts[2], "tracks_mb": round(tracks / 1e6), "mode": mode,
            "memory": training.memory, "start_s": f"{training.start_s:.2f}",
            "start_cpu_s": f"{training.start_cpu_s:.2f}", "peak_mb": f"{peak:.0f}", "steps": log[-1][1] if timed else "",
            "ms_per_step": f"{1e3 * (log[-1][0] - log[0][0]) / (log[-1][1] - log[0][1]):.1f}" if timed else "",
            "cpu_ms_per_step": cpu}


def memory_cgroup():
    if "LIMIT" not in os.environ:
        return None
    group = "/sys/fs/cgroup/memory/large_data"
    os.makedirs(group, exist_ok=True)
    with open(os.path.join(group, "memory.limit_in_bytes"), "w") as file:
        file.write(os.environ["LIMIT"])
    return group


def measure(train, folder, memory, seconds, options, scratch):
    out = os.path.join(scratch, "model%d.safetensors")
    kept = os.path.join(folder, ".supertac")
    shutil.rmtree(kept, ignore_errors=True)
    first = Training(train, folder, out % 0, [*options, "--memory", memory])
    peak, _ = first.end()
    yield row(folder, "first", first, peak, [], "")
    held = Training(train, folder, out % 1, options)
    held.send(signal.SIGSTOP)
    read = Training(train, folder, out % 2, [*options, "--memory", memory], memory_cgroup())
    held.send(signal.SIGCONT)
    both = {"held": held, "read": read}
    seen = {mode: [] for mode in both}  # (step, seconds of the processor) at each new line of the log
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(0.1)
        for mode, training in both.items():
            log = training.log()
            if log and (not seen[mode] or log[-1][1] > seen[mode][-1][0]):
                seen[mode].append((log[-1][1], training.cpu_s()))
    for mode, training in both.items():
        peak, log = training.end()
        (first, cpu_first), (last, cpu_last) = seen[mode][0], seen[mode][-1]
        log = [line for line in log if first <= line[1] <= last]
        cpu = f"{1e3 * (cpu_last - cpu_first) / (last - first):.1f}" if last > first else ""
        yield row(folder, mode, training, peak, log, cpu)


def main():
    words, options = sys.argv[1:], []
    if "--" in words:
        options = words[words.index("--") + 1:]
        words = words[:words.index("--")]
    bin_dir, table, memory, seconds, *folders = words
    scratch = table + ".runs"
    os.makedirs(scratch, exist_ok=True)
    with open(table, "w") as file:
        writer = csv.DictWriter(file, [*COLUMNS, *source()])
        writer.writeheader()
        for folder in folders:
            train = os.path.join(bin_dir, "supertac-train")
            for line in measure(train, folder, memory, float(seconds), options, scratch):
                writer.writerow(line | source())
                file.flush()
                print(line, flush=True)
    shutil.rmtree(scratch)


if __name__ == "__main__":
    main()
