#!/usr/bin/env python3
"""Stop on the page of a collection, in any of twelve tabs of two browsers, one of which has slept.

    tests/apps/web/stop_test.py BIN [REPETITIONS]    BIN: the folder of our programs

A browser's sleep is a network that keeps its connections and lets nothing through, and takes new ones: between this browser
and the program stands a proxy. The finger is up when the rig's printer has it a millimetre above contact. Ends with 77,
after one line, where Chromium or its driver is not installed.
"""

import contextlib
import os
import pathlib
import random
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time

from browser import Browser
from page_test import wait_until

TABS, WITHIN_S = 6, 2.0


class Sleeper:
    """A proxy in front of a port; what it has when it is told to sleep is dead from then on, without an end."""

    def __init__(self, port):
        self.port, self.pairs = port, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}/"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                near, _ = self.listener.accept()
                far = socket.create_connection(("127.0.0.1", self.port))
                dead = threading.Event()
                self.pairs.append(dead)
                for a, b in ((near, far), (far, near)):
                    threading.Thread(target=self.pump, args=(a, b, dead), daemon=True).start()

    @staticmethod
    def pump(a, b, dead):
        with contextlib.suppress(OSError):
            while data := a.recv(65536):
                while dead.is_set():
                    time.sleep(0.1)
                b.sendall(data)
            b.shutdown(socket.SHUT_WR)

    def sleep(self):
        for dead in self.pairs:
            dead.set()


def real_time():
    """For what stands for a board and a printer, which wait for no processor of this machine."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(5))


class PrinterTap:
    """Between program and printer: when the stop and the lift behind it went through, and when the planner had the lift."""

    def __init__(self, inner, link):
        import pty
        import tty

        self.end, terminal = pty.openpty()
        tty.setraw(terminal)
        os.symlink(os.ttyname(terminal), link)
        self.inner = os.open(inner, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.inner)
        self.times, self.slides, self.owed, self.terminal = {}, 0, 0, terminal
        for a, b in ((self.end, self.inner), (self.inner, self.end)):
            threading.Thread(target=self.pump, args=(a, b), daemon=True).start()

    def pump(self, a, b):
        real_time()
        with contextlib.suppress(OSError):
            while data := os.read(a, 4096):
                now = time.monotonic()
                if a == self.end and "lift" not in self.times:
                    self.slides += len(re.findall(rb"G1 X\S+ Y209", data))
                    before, lift, _ = data.partition(b" G1 Z")
                    self.owed += len(re.findall(rb"[^\n]\n", before)) + (lift != b"")
                    if b"M410" in before:
                        self.times["stop"] = now
                    if lift:
                        self.times["lift"] = now
                elif a == self.inner:
                    self.owed -= data.count(b"ok\n")
                    if "lift" in self.times and self.owed <= 0:
                        self.times.setdefault("taken", now)  # the head starts 0.11 s later
                os.write(b, data)


def tab(browser, url):
    handle = browser.call("POST", "/window/new", {"type": "tab"})["handle"]
    browser.call("POST", "/window", {"handle": handle})
    browser.open(url)
    return handle


def lamp(browser):
    return browser.js("return document.getElementById('link').textContent")


def one_stop(binaries, folder, browsers, number, dice):
    """Returns how long after the click stop and lift passed and the printer had taken the lift, and how the program ended."""
    with contextlib.ExitStack() as stack:
        home = folder / str(number)
        home.mkdir()
        rig = [binaries / "supertac-rig", "--plate", "6_Ridges", "--board-link", home / "board", "--printer-link", home / "inner"]
        rig = subprocess.Popen(rig, stdout=subprocess.PIPE, text=True, preexec_fn=real_time)
        stack.callback(rig.wait)
        stack.callback(rig.terminate)
        assert rig.stdout.readline() == "ready\n"
        tap = PrinterTap(home / "inner", home / "printer")
        command = [binaries / "supertac-collect", "--board", home / "board", "--printer", home / "printer", "--plate", "6_Ridges"]
        command += ["--passes", "8", "--yes", "--web", "0", "--out", home / "out"]
        state = dict(os.environ, XDG_STATE_HOME=str(home))
        program = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=state)
        stack.callback(program.kill)
        url = next(m[1] for line in program.stderr if (m := re.search(r"live page: (\S+)", line)))
        threading.Thread(target=program.stderr.read, daemon=True).start()
        proxy = Sleeper(int(url.rsplit(":", 1)[1]))
        stack.callback(proxy.listener.close)
        tabs = [(browser, tab(browser, address)) for browser, address in zip(browsers, (url, proxy.url)) for _ in range(TABS)]
        for browser, handle in tabs:
            browser.call("POST", "/window", {"handle": handle})
            wait_until("a live tab", lambda: lamp(browser) == "live", 30)  # noqa: B023
        wait_until("a slide", lambda: tap.slides > 0, 60)
        time.sleep(0.3 + dice.random())
        if number % 2:
            proxy.sleep()
        browser, handle = dice.choice(tabs[TABS:] if number % 2 else tabs)
        browser.call("POST", "/window", {"handle": handle})
        clicked = time.monotonic()  # at the earliest
        browser.js("document.getElementById('stop').click()")
        program.wait(30)
        parts = [tap.times.get(part, float("inf")) - clicked for part in ("stop", "lift", "taken")]
        said = r"the finger (was|is) lifted" if number % 2 else "the finger was lifted"  # the end may come before a new connection
        wait_until("its outcome", lambda: re.search(said, browser.js("return document.getElementById('said').textContent")), 10)
        for other, old in tabs:
            other.call("POST", "/window", {"handle": old})
            other.call("DELETE", "/window")
            other.call("POST", "/window", {"handle": other.first})
        return parts, program.returncode


def main():
    binaries = pathlib.Path(sys.argv[1]).resolve()
    repetitions = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    programs = [shutil.which("chromedriver"), shutil.which("chromium")]
    if None in programs:
        print("skipped: chromium and chromium-driver are not installed")
        return 77
    dice, worst, late = random.Random(7), 0, 0
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        browsers = [stack.enter_context(Browser(*programs, name)) for _ in range(2)]
        for browser in browsers:
            browser.first = browser.call("GET", "/window")
        for number in range(repetitions):
            parts, code = one_stop(binaries, pathlib.Path(name), browsers, number, dice)
            assert code == 130, code
            took = parts[-1] + 0.107 + 0.2  # the head starts; 1 mm at 5 mm/s
            worst, late = max(worst, took), late + (took > WITHIN_S)
            print(f"{number}: {'a slept browser' if number % 2 else 'both awake'}, finger up {took:.2f} s after the click; "
                  + ", ".join(f"{name} {s:.3f}" for name, s in zip(("stop", "lift", "taken"), parts)), flush=True)
    print(f"{repetitions} stops in {2 * TABS} tabs: finger up within {worst:.2f} s, {late} later than {WITHIN_S:.0f} s")
    return 0 if worst < 10 else 1


if __name__ == "__main__":
    sys.exit(main())
