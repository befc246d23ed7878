#!/usr/bin/env python3
"""Sends a signal at a random moment of every phase of every program that touches a port.

    bench/studies/rig/signal_runs.py BUILD [RUNS [FIRST_SEED]] > bench/results/rig/signals.csv

Each program must end within 2 s with 128 + signal; in contact it may take longer, and must say that the finger was
lifted. A second signal outside contact must end it within 0.2 s. Exit code 1 when one does not.
"""

import os
import pty
import random
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
import tty

PHASES = ["silent", "busy", "question", "homing", "approach", "slide", "list-ports", "stream", "check"]
SPEEDUP = 4


class Device(threading.Thread):
    """A pseudo-terminal that says ok to M110 and is then busy for ever, or says nothing at all."""

    def __init__(self, link, busy):
        super().__init__(daemon=True)
        self.master, slave = pty.openpty()
        tty.setraw(slave)
        os.symlink(os.ttyname(slave), link)
        self.busy = busy
        self.start()

    def run(self):
        last = time.monotonic()
        while True:
            if select.select([self.master], [], [], 0.1)[0]:
                data = os.read(self.master, 4096)
                if self.busy:
                    os.write(self.master, b"ok\n" * data.count(b"N0 M110"))
            if self.busy and time.monotonic() - last > 1:
                last = time.monotonic()
                os.write(self.master, b"echo:busy: processing\n")


def wait_for(condition, seconds):
    """Whether `condition` came true in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.01)
    return False


def command_of(phase, programs, folder):
    collect = [f"{programs}/supertac-collect", "--board", f"{folder}/board", "--printer", f"{folder}/printer", "--plate",
               "6_Ridges", "--passes", "1", "--out", f"{folder}/out", "--speedup", str(SPEEDUP)]
    return {"question": collect, "homing": collect + ["--yes", "--home"],
            "list-ports": [f"{programs}/supertac-collect", "--list-ports"],
            "check": [f"{programs}/supertac-check"],
            "stream": [f"{programs}/supertac-stream", "--board", f"{folder}/board", "--model", os.environ.get("MODEL", ""),
                       "--speedup", str(SPEEDUP)]}.get(phase, collect + ["--yes"])


def run(phase, seed, programs):
    """Moment, seconds to the end, exit code, and what was wrong."""
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        environment = dict(os.environ, XDG_STATE_HOME=f"{folder}/state")
        rig = subprocess.Popen([f"{programs}/supertac-rig", "--plate", "6_Ridges", "--board-link", f"{folder}/board", "--printer-link",
                                f"{folder}/rig", "--speedup", str(SPEEDUP)], stdout=subprocess.DEVNULL)
        try:
            wait_for(lambda: os.path.exists(f"{folder}/board") and os.path.exists(f"{folder}/rig"), 20)
            if phase in ("silent", "busy"):
                Device(f"{folder}/printer", phase == "busy")
            else:
                os.symlink(os.readlink(f"{folder}/rig"), f"{folder}/printer")
            terminal, inside = pty.openpty()
            program = subprocess.Popen(command_of(phase, programs, folder), stdin=inside, stdout=subprocess.DEVNULL,
                                       stderr=subprocess.PIPE, env=environment)
            moment = draw.uniform(*{"list-ports": (0, 0.05), "check": (0, 1), "homing": (0.5, 4), "approach": (0.5, 3),
                                    "slide": (6, 7.5)}.get(phase, (0.1, 2)))
            time.sleep(moment)
            number = draw.choice([signal.SIGINT, signal.SIGTERM])
            twice = phase not in ("slide", "approach") and draw.random() < 0.3
            ended_before = program.poll() is not None
            begin = time.monotonic()
            program.send_signal(number)
            if twice:
                time.sleep(0.1)
                begin = time.monotonic()
                program.send_signal(number)
            try:
                text = program.communicate(timeout=40)[1].decode(errors="replace")
            except subprocess.TimeoutExpired:
                program.kill()
                text = program.communicate()[1].decode(errors="replace")
            seconds = time.monotonic() - begin
            os.close(terminal)
            os.close(inside)
        finally:
            rig.terminate()
            rig.wait()
    code = program.returncode if program.returncode >= 0 else 128 - program.returncode
    wrong = ""
    if not ended_before and code not in (128 + number, 0 if phase in ("list-ports", "check") else 128 + number):
        wrong = f"exit code {code}: {text.strip()[-200:]}"
    elif seconds > (0.2 if twice else 2) and "the finger was lifted" not in text:
        wrong = f"took {seconds:.2f} s: {text.strip()[-200:]}"
    return moment, seconds, code, twice, wrong.replace('"', "'").replace("\n", " ").replace("\r", " ")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    programs = sys.argv[1] + "/bin"
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else 300
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 1
    phases = [phase for phase in PHASES if phase not in ("stream", "check") or os.path.exists(f"{programs}/supertac-{phase}")]
    if "MODEL" not in os.environ and "stream" in phases:
        phases.remove("stream")  # needs a model
    broken = 0
    print("phase,seed,moment_s,seconds,code,twice,broken")
    for seed in range(first, first + runs):
        phase = phases[seed % len(phases)]
        moment, seconds, code, twice, wrong = run(phase, seed, programs)
        broken += wrong != ""
        print(f'{phase},{seed},{moment:.2f},{seconds:.3f},{code},{int(twice)},"{wrong}"', flush=True)
    print(f"{runs} signals, {broken} broken promises", file=sys.stderr)
    sys.exit(1 if broken else 0)


if __name__ == "__main__":
    main()
