#!/usr/bin/env python3
"""What the live page costs the stream that it shows, on a virtual rig whose finger slides to and fro.

    bench/studies/rig/page_load.py BIN MODEL load [PAIRS]   with and without 50 pages (5 of them stalled), 60 slow connections and
                                                        malformed requests, 100,000 in all, by turns; a line of CSV a run;
                                                        the processors kept awake in both
    bench/studies/rig/page_load.py BIN MODEL udp [SECONDS]  the datagrams that PlotJuggler's server would get, each parsed
    bench/studies/rig/page_load.py BIN MODEL hour [SECONDS] one page in Chromium for an hour; a line of CSV a minute

BIN is the folder of our programs. As in stream_soak, chrt -r 10 keeps other work of the machine out of the latency.
"""

import contextlib
import json
import os
import pathlib
import random
import re
import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "tests" / "apps"))
from browser import Browser
from page_test import Rig

PAGES, STALLED, SLOW, MALFORMED, SECONDS = 50, 5, 60, 100_000, 30
SLIDES = ["G92 X99.7 Y101.17 Z131.81", "G1 Z91.81 F1200"]


def give_way(policy):
    """Load and browser are no part of what is measured. The load stands for other machines and gets what this one has left
    (SCHED_IDLE), also behind the kernel's own threads, which hand over what came at a port."""
    os.sched_setscheduler(0, policy, os.sched_param(0))


def keep_sliding(rig, end):
    rig.move(SLIDES)
    while not end.wait(10.8):
        rig.move(["G1 Y209.17 F1200", "G1 Y101.17 F1200"])


class Stream:
    def __init__(self, binaries, model, board, folder, web):
        command = [binaries / "supertac-stream", "--board", board, "--model", model, "--json", folder / "result.json", "--force"]
        self.result = folder / "result.json"
        self.process = subprocess.Popen(command + (["--web", "0"] if web else []), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
        line = next(line for line in self.process.stderr if "live page:" in line or not web and "ready" in line)
        self.port = int(line.rsplit(":", 1)[1]) if web else 0
        threading.Thread(target=self.process.stderr.read, daemon=True).start()

    def resident_kb(self):
        return int(re.search(r"VmRSS:\s+(\d+)", pathlib.Path(f"/proc/{self.process.pid}/status").read_text())[1])

    def stop(self):
        self.process.terminate()
        self.process.wait(30)
        return json.loads(self.result.read_text())


def bad_request(rng, port):
    text = bytearray(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\nX-Token: a\r\n\r\n".encode())
    for _ in range(1 + rng.randrange(8)):
        at = rng.randrange(len(text) or 1)
        text[at : at + rng.randrange(20)] = rng.randbytes(rng.randrange(30))
    return bytes(text)


def attack(port, seconds, malformed):
    """Pages that read, pages and connections that do not, and malformed requests in between. Prints what came of it."""
    rng, watch, events, answered = random.Random(port), selectors.DefaultSelector(), 0, 0
    own = f"Host: 127.0.0.1:{port}\r\n\r\n".encode()
    kept = []
    for i in range(PAGES + SLOW):
        client = socket.socket()
        if i < STALLED:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        client.connect(("127.0.0.1", port))
        client.sendall(b"GET /events HTTP/1.1\r\n" + own if i < PAGES else b"GET /ev")
        client.setblocking(False)
        if STALLED <= i < PAGES:
            watch.register(client, selectors.EVENT_READ)
        kept.append(client)
    begin = time.monotonic()
    for sent in range(malformed):
        due = begin + seconds * sent / malformed
        while True:
            for key, _ in watch.select(max(0, due - time.monotonic())):
                got = key.fileobj.recv(1 << 16)
                events += got.count(b"data: {")
                if not got:
                    watch.unregister(key.fileobj)
            if time.monotonic() >= due:
                break
        with socket.socket() as client:
            client.connect(("127.0.0.1", port))
            client.send(bad_request(rng, port))
            if sent % 100 == 0:
                client.settimeout(1)
                try:
                    answered += client.recv(16).startswith(b"HTTP/1.")
                except OSError:
                    pass
    print(json.dumps({"events": events, "answered": answered, "pages": len(watch.get_map()), "seconds": time.monotonic() - begin}))


@contextlib.contextmanager
def kept_awake():
    """Every processor has something to do that yields to everything else: a virtual machine's processor that halts is given
    to others by the host and comes back milliseconds later, which is what a p99 would then measure."""
    words = [sys.executable, "-c", "while True: pass"]
    idle = [subprocess.Popen(words, preexec_fn=lambda: give_way(os.SCHED_IDLE)) for _ in range(os.cpu_count())]
    try:
        yield
    finally:
        for process in idle:
            process.kill()
            process.wait()


def processor_time():
    """Of the machine since its start: all, and what the host gave to others meanwhile."""
    times = list(map(int, pathlib.Path("/proc/stat").read_text().split("\n")[0].split()[1:9]))
    return sum(times), times[7]


def run_once(binaries, model, folder, loaded, malformed):
    """The stream's own figures, after SECONDS with the load or without a page."""
    rig, end = Rig(binaries, folder), threading.Event()
    sliding = threading.Thread(target=keep_sliding, args=(rig, end))
    sliding.start()
    stream = Stream(binaries, model, rig.board, folder, loaded)
    came = {"events": 0, "answered": 0, "pages": 0, "seconds": SECONDS}
    if loaded:
        words = [sys.executable, __file__, "attack", str(stream.port), str(SECONDS), str(malformed)]
        came = json.loads(subprocess.run(words, stdout=subprocess.PIPE, check=True, preexec_fn=lambda: give_way(os.SCHED_IDLE)).stdout)
    else:
        time.sleep(SECONDS)
    resident = stream.resident_kb()
    result = stream.stop()
    end.set()
    rig.stop()
    sliding.join()
    return result, came, resident


def load(binaries, model, pairs):
    print("pair,load,seconds,frames,lost,dropped,median_ms,p99_ms,pages_served,events_a_page_a_second,resident_kb,stolen_percent", flush=True)
    for pair in range(pairs):
        for loaded in (pair % 2 == 0, pair % 2 == 1):
            before = processor_time()
            with tempfile.TemporaryDirectory() as name, kept_awake():
                result, came, resident = run_once(binaries, model, pathlib.Path(name), loaded, MALFORMED // pairs)
            all_time, stolen = (now - then for now, then in zip(processor_time(), before))
            latency = result["latency_ms"]
            rate = came["events"] / came["pages"] / came["seconds"] if came["pages"] else 0
            print(f"{pair},{'with' if loaded else 'without'},{result['seconds']:.1f},{result['frames']},{result['lost']},{result['dropped']},"
                  f"{latency['median']:.3f},{latency['p99']:.3f},{came['pages']},{rate:.1f},{resident},{100 * stolen / all_time:.2f}", flush=True)


def sent_to_page(port):
    """Bytes that the kernel has sent on the busiest connection of this port."""
    said = subprocess.run(["ss", "-tinH", f"sport = :{port}"], stdout=subprocess.PIPE, text=True, check=True).stdout
    return max(map(int, re.findall(r"bytes_sent:(\d+)", said)), default=0)


def hour(binaries, model, seconds):
    print("seconds,page_heap_kb,bytes_a_second,pictures_drawn,program_resident_kb,program_descriptors", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        rig, end = Rig(binaries, folder), threading.Event()
        sliding = threading.Thread(target=keep_sliding, args=(rig, end))
        sliding.start()
        stream = Stream(binaries, model, rig.board, folder, True)
        give_way(os.SCHED_OTHER)
        with Browser(shutil.which("chromedriver"), shutil.which("chromium"), folder) as browser:
            browser.look(1280, 860)
            browser.open(f"http://127.0.0.1:{stream.port}")
            browser.js("window.drawn = 0; const old = drawPictures; drawPictures = (e) => { ++window.drawn; old(e); };")
            time.sleep(20)
            begin = last = time.monotonic()
            sent, drawn = sent_to_page(stream.port), browser.js("return window.drawn")
            while last - begin < seconds:
                time.sleep(min(60, seconds))
                browser.cdp("HeapProfiler.collectGarbage")
                heap = browser.cdp("Runtime.getHeapUsage")["usedSize"]
                now, now_sent, now_drawn = time.monotonic(), sent_to_page(stream.port), browser.js("return window.drawn")
                descriptors = len(os.listdir(f"/proc/{stream.process.pid}/fd"))
                print(f"{now - begin:.0f},{heap / 1024:.0f},{(now_sent - sent) / (now - last):.0f},{now_drawn - drawn},"
                      f"{stream.resident_kb()},{descriptors}", flush=True)
                last, sent, drawn = now, now_sent, now_drawn
        result = stream.stop()
        end.set()
        rig.stop()
        sliding.join()
    print(f"lost {result['lost']} of {result['frames']} frames, dropped {result['dropped']}", file=sys.stderr)


def udp(binaries, model, seconds):
    with tempfile.TemporaryDirectory() as name, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        folder = pathlib.Path(name)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(5)
        rig, got = Rig(binaries, folder), []
        address = f"127.0.0.1:{receiver.getsockname()[1]}"
        command = [binaries / "supertac-stream", "--board", rig.board, "--model", model, "--json", folder / "result.json", "--quiet"]
        stream = subprocess.Popen([*command, "--udp", address, "--seconds", str(seconds)], stdout=subprocess.DEVNULL)
        while stream.poll() is None:
            try:
                got.append(json.loads(receiver.recv(65536)))
            except TimeoutError:
                pass
        rig.stop()
        sent = json.loads((folder / "result.json").read_text())
    numbers, times = [one["number"] for one in got], [one["timestamp"] for one in got]
    print("pictures,datagrams,lost_or_out_of_order,a_second")
    print(f"{sent['pictures']},{len(got)},{sent['pictures'] - sum(n == i for i, n in enumerate(numbers))},"
          f"{(len(got) - 1) / (times[-1] - times[0]):.1f}")


def main():
    if sys.argv[1] == "attack":
        return attack(int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]))
    binaries, model = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    if sys.argv[3] == "hour":
        return hour(binaries, model, float(sys.argv[4]) if len(sys.argv) > 4 else 3600)
    if sys.argv[3] == "udp":
        return udp(binaries, model, float(sys.argv[4]) if len(sys.argv) > 4 else 60)
    return load(binaries, model, int(sys.argv[4]) if len(sys.argv) > 4 else 8)


if __name__ == "__main__":
    main()
