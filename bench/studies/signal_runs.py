#!/usr/bin/env python3
"""Sends a signal at a random moment of every phase of every program that touches a port.

    bench/studies/signal_runs.py BUILD [RUNS [FIRST_SEED]] > bench/results/rig/signals.csv

Each program must end within 2 s with 128 + signal; in contact it may take longer, and must say that the finger was
lifted. A second signal outside contact must end it within 0.2 s. Programs that end by themselves, and collections that
a starved rig has ended, may do so before the signal; they are counted apart.
Exit code 1 when one does not. The stalls of this machine are measured beside each run and deducted.
"""

import csv
import os
import pathlib
import pty
import random
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import source  # noqa: E402

SPEEDUP = 4
SENSOR = """{"rows": 4, "columns": 4, "rate_hz": 100, "pressed": "higher", "range": [0, 900], "port": "%s",
 "frame": {"kind": "text", "time": {"column": 0, "unit": "ms"}}}"""
# The phases, and between which seconds after the start the signal comes: a start that is read and set up, and later.
COLLECTING = {"silent": (0, 3), "busy": (0, 3), "question": (0, 2), "homing": (0, 4), "approach": (0, 3), "slide": (5, 8)}
STREAMING = {f"{what} {port}": (0, 1.5) for what in ("stream", "probe") for port in ("serial", "tcp", "udp", "fifo", "mute", "far")}
PHASES = {**COLLECTING, "check machine": (0, 0.02),
          "stream board": (0, 1.5), "stream board all outputs": (0, 1.5), "stream printer": (0, 2), **STREAMING}
# What ends by itself, perhaps while the signal is on its way.
OWN_ENDS = {"check machine": 0, "stream printer": 1}


class StallWatch(threading.Thread):
    """The longest time for which this machine gave a thread that sleeps 5 ms no processor."""

    def __init__(self):
        super().__init__(daemon=True)
        self.longest, self.going = 0, True
        self.start()

    def run(self):
        while self.going:
            before = time.monotonic()
            time.sleep(0.005)
            self.longest = max(self.longest, time.monotonic() - before - 0.005)

    def stop(self):
        self.going = False
        self.join()
        return self.longest


class Device(threading.Thread):
    """A pseudo-terminal with a printer that is silent or busy for ever, or with a sensor of text."""

    def __init__(self, link, kind):
        super().__init__(daemon=True)
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        os.symlink(os.ttyname(slave), link)
        self.kind = kind
        self.start()

    def run(self):
        last = time.monotonic()
        for n in range(1_000_000):
            if self.kind == "sensor":
                time.sleep(0.01)
                select.select([], [self.master], [], 1)
                os.write(self.master, line_of(n))
                continue
            if select.select([self.master], [], [], 0.1)[0]:
                data = os.read(self.master, 4096)
                if self.kind == "busy":
                    os.write(self.master, b"ok\n" * data.count(b"N0 M110"))
            if self.kind == "busy" and time.monotonic() - last > 1:
                last = time.monotonic()
                os.write(self.master, b"echo:busy: processing\n")


def line_of(n):
    return (f"{10 * n}," + ",".join(str(100 + (n + k) % 7) for k in range(16)) + "\n").encode()


class Network:
    """Sends lines over TCP or UDP; or takes no connection: the queue of those that wait is full."""

    def __init__(self, kind):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if kind == "udp" else socket.SOCK_STREAM)
        self.socket.bind(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        if kind == "udp":
            self.socket.close()
            self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        else:
            self.socket.listen(0)
        self.waiting = []
        for _ in range(4 if kind == "far" else 0):
            self.waiting.append(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            self.waiting[-1].setblocking(False)
            self.waiting[-1].connect_ex(("127.0.0.1", self.port))
        if kind in ("tcp", "udp"):
            threading.Thread(target=self.send, args=[kind], daemon=True).start()

    def send(self, kind):
        try:
            to = self.socket.accept()[0] if kind == "tcp" else self.socket
            for n in range(1_000_000):
                time.sleep(0.01)
                to.sendto(line_of(n), ("127.0.0.1", self.port)) if kind == "udp" else to.sendall(line_of(n))
        except OSError:
            pass

    def close(self):
        for file in [self.socket, *self.waiting]:
            file.close()


def wait_for(condition, seconds):
    """Whether `condition` came true in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.01)
    return False


def is_pending(process, number):
    """Whether a signal has not reached it yet; a second one would be lost in the first."""
    try:
        with open(f"/proc/{process}/status") as status:
            pending = [int(line.split()[1], 16) for line in status if line.startswith(("SigPnd", "ShdPnd"))]
    except OSError:
        return False
    return any(mask >> (number - 1) & 1 for mask in pending)


def is_dead(process):
    """Whether it runs no more. On a busy machine the kernel may hold a thread that waits for a pseudo-terminal's own work
    (n_tty_poll, __flush_work), with its process, for another second."""
    try:
        with open(f"/proc/{process}/stat") as status:
            return status.read().rsplit(")", 1)[1].split()[0] in "ZX"
    except OSError:
        return True


def write_to(fifo):
    """A writer of a FIFO, who waits for its reader."""
    def run():
        try:
            with open(fifo, "wb", buffering=0) as out:
                for n in range(1_000_000):
                    time.sleep(0.01)
                    out.write(line_of(n))
        except OSError:
            pass
    threading.Thread(target=run, daemon=True).start()


def sensor_command(phase, programs, folder, network):
    """supertac-stream on a sensor at a port of the phase's kind, probed or shown."""
    what, kind = phase.split()
    device = f"{folder}/device"
    if kind in ("serial", "mute"):
        Device(device, "sensor" if kind == "serial" else "silent")
    if kind == "fifo":
        os.mkfifo(device)
        write_to(device)
    port = {"serial": f"serial:{device}@115200", "mute": f"serial:{device}@115200", "fifo": device}.get(kind, "")
    if network:
        port = f"{'udp' if kind == 'udp' else 'tcp'}:127.0.0.1:{network.port}"
    file = f"{folder}/sensor.json"
    with open(file, "w") as out:
        out.write(SENSOR % port)
    command = [f"{programs}/supertac-stream", "--sensor", file]
    return command + (["--probe", "--out", f"{folder}/draft.json"] if what == "probe" else ["--record", f"{folder}/kept"])


def command_of(phase, programs, folder, network):
    if phase in STREAMING:
        return sensor_command(phase, programs, folder, network)
    stream = [f"{programs}/supertac-stream", "--speedup", str(SPEEDUP), "--board"]
    every = ["--capture", f"{folder}/capture", "--record", f"{folder}/kept", "--out", f"{folder}/seen", "--json", f"{folder}/json",
             "--web", "0"]
    collect = [f"{programs}/supertac-collect", "--board", f"{folder}/board", "--printer", f"{folder}/printer", "--plate",
               "6_Ridges", "--passes", "1", "--out", f"{folder}/out", "--speedup", str(SPEEDUP)]
    return {"question": collect, "homing": [*collect, "--yes", "--home"],
            "check machine": [f"{programs}/supertac-check", "machine"],
            "stream board": [*stream, f"{folder}/board"], "stream board all outputs": [*stream, f"{folder}/board", *every],
            "stream printer": [*stream, f"{folder}/printer"]}.get(phase, [*collect, "--yes"])


def judge(run):
    """What was wrong with a run."""
    number, code, text = run["signal"], run["code"], run["text"].strip()[-200:]
    if code not in (128 + number, OWN_ENDS.get(run["phase"])) and not (run["ended_before"] and code == 1):
        return f"exit code {code}, expected {128 + number}: {text}"
    if run["seconds"] - run["stall_s"] > (0.2 if run["twice"] else 2) and "the finger was lifted" not in text:
        return f"took {run['seconds']:.2f} s: {text}"
    return ""


def run_once(phase, seed, programs):
    draw = random.Random(seed)
    run = {"phase": phase, "seed": seed, "moment_s": draw.uniform(*PHASES[phase]), "signal": draw.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])}
    run["twice"] = int(phase not in ("slide", "approach") and draw.random() < 0.3)
    kind = phase.split()[-1]
    network = Network(kind) if phase in STREAMING and kind in ("tcp", "udp", "far") else None
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, XDG_STATE_HOME=f"{folder}/state")
        rig = None
        if phase in COLLECTING or "board" in phase or "printer" in phase:
            rig = subprocess.Popen([f"{programs}/supertac-rig", "--plate", "6_Ridges", "--board-link", f"{folder}/board", "--printer-link",
                                    f"{folder}/rig", "--speedup", str(SPEEDUP)], stdout=subprocess.PIPE)
            rig.stdout.readline()  # ready
        try:
            if phase in ("silent", "busy"):
                Device(f"{folder}/printer", phase)
            elif rig:
                os.symlink(os.readlink(f"{folder}/rig"), f"{folder}/printer")
            terminal, inside = pty.openpty()
            program = subprocess.Popen(command_of(phase, programs, folder, network), stdin=inside, stdout=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, env=environment)
            time.sleep(run["moment_s"])
            run["ended_before"] = program.poll() is not None
            stalls = StallWatch()
            begin = time.monotonic()
            program.send_signal(run["signal"])
            if run["twice"]:
                time.sleep(0.1)
                wait_for(lambda: not is_pending(program.pid, run["signal"]), 10)
                begin = time.monotonic()
                program.send_signal(run["signal"])
            if not wait_for(lambda: is_dead(program.pid), 40):
                program.kill()
            run["seconds"] = time.monotonic() - begin
            text = program.communicate()[1]
            run["stall_s"] = stalls.stop()
            run["text"] = text.decode(errors="replace")
            os.close(terminal)
            os.close(inside)
        finally:
            if network:
                network.close()
            if rig:
                rig.terminate()
                rig.wait()
    run["code"] = program.returncode if program.returncode >= 0 else 128 - program.returncode
    return run


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else 300
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    broken = late = 0
    columns = ["phase", "seed", "moment_s", "signal", "twice", "seconds", "stall_s", "code", "ended_before", "broken", "command", "commit"]
    out = csv.DictWriter(sys.stdout, columns, extrasaction="ignore", lineterminator="\n")
    out.writeheader()
    made = source()
    for seed in range(first, first + runs):
        phase = list(PHASES)[seed % len(PHASES)]
        run = run_once(phase, seed, sys.argv[1] + "/bin")
        wrong = " ".join(judge(run).split())
        broken += wrong != ""
        late += run["ended_before"]
        numbers = {name: f"{run[name]:.3f}" for name in ("moment_s", "seconds", "stall_s")}
        out.writerow({**run, **numbers, "signal": int(run["signal"]), "ended_before": int(run["ended_before"]), "broken": wrong, **made})
        sys.stdout.flush()
        made = {"command": "", "commit": ""}
    print(f"{runs - late} signals to running programs, {late} programs had ended, {broken} broken promises", file=sys.stderr)
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
