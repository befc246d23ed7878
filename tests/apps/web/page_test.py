#!/usr/bin/env python3
"""The live page in a real Chromium, on a virtual rig whose finger slides, and on a sensor that is probed.

    tests/apps/web/page_test.py BIN [SCREENSHOTS]    BIN: the folder of our programs; SCREENSHOTS: keep some in this folder

Ends with 77, after one line, where Chromium or its driver is not installed.
"""

import contextlib
import json
import os
import pathlib
import pty
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
import tty

from browser import Browser, Png

# Marlin is told where the head stands; the finger goes down, twice over the plate, and rests on the texture.
SLIDES = ["G92 X99.7 Y101.17 Z131.81", "G1 Z91.81 F300", "G1 Y209.17 F600", "G1 Y101.17 F600", "G1 Y155.17 F1200"]


def wait_until(what, condition, seconds=200):
    end = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < end, f"not within {seconds} s: {what}"
        time.sleep(0.05)
    return value


def read_safetensors(data):
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    header.pop("__metadata__")
    return header, data[8 + size :]


def row_of(data, name, row):
    """A picture of a log, as floats."""
    header, body = read_safetensors(data)
    count, *shape = header[name]["shape"]
    assert row < count, f"picture {row} of {count}"
    size = shape[0] * shape[1] if len(shape) == 2 else 1
    begin = header[name]["data_offsets"][0] + 4 * size * row
    return struct.unpack(f"<{size}f", body[begin : begin + 4 * size])


def make_lively(path):
    """Turns an untrained model into one whose pictures follow its signals, into a file of another writer."""
    gains = {"mean.weight": lambda v: 1000 * v, "upsampler.out.weight": lambda v: 10 * v, "upsampler.out.bias": lambda _: 0.5}
    data = bytearray(path.read_bytes())
    header, _ = read_safetensors(data)
    (size,) = struct.unpack("<Q", data[:8])
    for name, entry in header.items():
        gain = next((gain for end, gain in gains.items() if name.endswith(end)), None)
        if gain:
            begin, end = (8 + size + offset for offset in entry["data_offsets"])
            values = struct.unpack(f"<{(end - begin) // 4}f", data[begin:end])
            data[begin:end] = struct.pack(f"<{len(values)}f", *map(gain, values))
    metadata = json.loads(data[8 : 8 + size])["__metadata__"]
    kept = {key: text for key, text in metadata.items() if key not in ("checksum", "supertac_format")}
    text = json.dumps({"__metadata__": kept, **header}).encode()
    text += b" " * (-len(text) % 8)
    path.write_bytes(struct.pack("<Q", len(text)) + text + data[8 + size :])


class Rig:
    """supertac-rig with a finger that can be moved."""

    def __init__(self, binaries, folder):
        self.board = folder / "board"
        command = [binaries / "supertac-rig", "--plate", "6_Ridges", "--board-link", self.board, "--printer-link", folder / "printer"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == "ready\n"
        self.printer = os.open(folder / "printer", os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.printer)
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        with contextlib.suppress(OSError):
            while os.read(self.printer, 4096):
                pass

    def move(self, lines):
        os.write(self.printer, "".join(line + "\n" for line in lines).encode())

    def stop(self):
        self.process.terminate()
        self.process.wait()


class Stream:
    """supertac-stream with a page at the given port (0: any)."""

    def __init__(self, binaries, source, folder, out, port=0):
        command = [binaries / "supertac-stream", *source, "--model", folder / "model.safetensors"]
        command += ["--out", out, "--web", str(port), "--force"]
        self.process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=folder)
        self.url = next(m[1] for line in self.process.stderr if (m := re.search(r"live page: (\S+)", line)))
        threading.Thread(target=self.process.stderr.read, daemon=True).start()

    def stop(self):
        self.process.terminate()
        assert self.process.wait(200) == 143


def shown(browser):
    return browser.js("return supertac.shown && supertac.shown.picture ? supertac.shown.n : -1")


def felt(browser):
    return browser.js("return supertac.newest.felt.reduce((a, b) => a + b) / supertac.newest.felt.length / 255")


def is_at_rest(browser):
    before = felt(browser)
    time.sleep(0.5)
    return abs(felt(browser) - before) < 0.01


def text(browser, name):
    return browser.js(f"return document.getElementById('{name}').textContent")


def check_changes(browser):
    """Both pictures change while the finger slides."""
    pictures, arrays = set(), set()

    def more():
        pictures.add(browser.js("return String(supertac.shown.picture)"))
        arrays.add(browser.js("return String(supertac.shown.felt)"))
        return len(pictures) > 10 and len(arrays) > 10

    wait_until("more than ten different pictures and arrays", more)


def colours_on_screen(browser):
    """Of the centres of the drawn picture's pixels on a screenshot, row 0 at the bottom, and the picture's number."""
    place = browser.js(
        "const r = document.getElementById('drawn').getBoundingClientRect(), b = supertac.box, h = supertac.hello;"
        "return [r.left + b.x, r.top + b.y, b.w, b.h, h.rows * h.scale, h.columns * h.scale, supertac.shown.n]"
    )
    left, top, width, height, rows, columns, number = place
    png = Png(browser.screenshot())
    centres = [
        (left + (c + 0.5) * width / columns, top + height - (r + 0.5) * height / rows) for r in range(rows) for c in range(columns)
    ]
    return number, [png.at(x, y) for x, y in centres]


def expected_colours(values, colour_map):
    for value in values:
        level = int(255 * min(max(value, 0), 1) + 0.5)
        yield tuple(colour_map[3 * level : 3 * level + 3])


def check_pause(browser):
    """Space holds the picture and lets it go again; what is chosen meanwhile is drawn. Returns what was seen."""
    browser.press(" ")
    wait_until("it says so", lambda: text(browser, "link") == "paused")
    if browser.js("return document.getElementById('guess').checked"):
        browser.press("g")
    # a browser that is short of time shows what was drawn some frames later
    browser.js("return new Promise(done => { let n = 0; (function frame() { ++n < 5 ? requestAnimationFrame(frame) : done(n); })(); })")
    before, newest = shown(browser), browser.js("return supertac.newest.n")
    shots = [None, colours_on_screen(browser)]

    def settled():
        shots[:] = shots[1], colours_on_screen(browser)
        return shots[0] == shots[1]

    wait_until("two screenshots alike", settled)
    seen = shots[1]
    wait_until("the stream goes on", lambda: browser.js("return supertac.newest.n") > newest + 200)
    assert shown(browser) == before
    browser.press(" ")
    wait_until("the picture goes on", lambda: shown(browser) > before + 200)
    return seen


def check_rezero(browser):
    """What the resting finger feels is then taken for nothing."""
    before = felt(browser)
    browser.press("z")
    wait_until(f"re-zero: felt {before}, now less", lambda: felt(browser) < before / 3)
    assert before > 0.05
    wait_until("what was done", lambda: "nothing" in text(browser, "said"))


def check_record(browser, folder):
    """R begins and ends a recording, whose name is shown; a training could read it."""
    browser.press("r")
    name = wait_until("a name", lambda: re.search(r"recording (recording_\S+\.safetensors)", text(browser, "said")))[1]
    wait_until("1 s recorded", lambda: browser.js("return supertac.newest.recorded_s") > 1)
    browser.press("r")
    wait_until("its end", lambda: text(browser, "said") == f"recorded {name}")
    data = (folder / name).read_bytes()
    header, _ = read_safetensors(data)
    metadata = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])["__metadata__"]
    assert 1 < header["volts"]["shape"][0] < 20000 and metadata["kind"] == "recording", metadata


def check_elements(binaries, folder, browser, screenshots):
    """Where places are known, the map's elements stand in a table as wide as a phone has room for."""
    recording = next((folder / "data").glob("*.safetensors"))
    stream = Stream(binaries, ["--recording", recording], folder, folder / "slide.safetensors")
    browser.look(400, 1800)
    browser.open(stream.url)
    wait_until("the end", lambda: text(browser, "said") == "the run has ended")
    count = int(re.match(r"\d+", text(browser, "elements-text"))[0])
    assert count > 0 and count == browser.js("return document.querySelectorAll('#elements tbody tr').length"), count
    assert browser.js("return element('elements').scrollWidth <= element('elements').clientWidth")
    if screenshots:
        (screenshots / "elements.png").write_bytes(browser.screenshot())
    stream.process.wait(200)


def check_snapshot(browser, folder):
    """S saves a PNG with both pictures: in its right half lie the drawn picture's colours."""
    browser.press("s")
    file = wait_until("a PNG", lambda: next(folder.glob("supertac_*.png"), None))
    wait_until("all of it", lambda: file.read_bytes()[-8:-4] == b"IEND")
    png = Png(file.read_bytes())
    assert (png.width, png.height) == (1640, 1000)
    colours = browser.js("return Array.from(supertac.hello.colours)")
    known = {tuple(colours[i : i + 3]) for i in range(0, len(colours), 3)}
    side = 2 * (390 - 36)
    centres = [(840 + 60 + (c + 0.5) * side / 16, 68 + 12 + (r + 0.5) * side / 16) for r in range(16) for c in range(16)]
    assert all(png.at(x, y) in known for x, y in centres)


class Mat:
    """A device on a pseudo-terminal that sends lines of 4x6 counts, 50 a second, one taxel pressed; the last never changes."""

    def __init__(self, wiring=range(24)):
        self.pressed, self.sending, self.wiring = 0, True, list(wiring)  # pressed: a place, or a set of them
        self.end, terminal = pty.openpty()
        tty.setraw(terminal)
        os.set_blocking(self.end, False)
        self.port = f"serial:{os.ttyname(terminal)}@115200"
        self.thread = threading.Thread(target=self.send)
        self.thread.start()

    def send(self):
        begin = time.monotonic()
        for n in range(10**6):
            if not self.sending:
                return
            time.sleep(max(0, begin + n / 50 - time.monotonic()))
            pressed = {self.wiring[p] for p in (self.pressed if isinstance(self.pressed, set) else {self.pressed})}
            values = [100 + 2 * k + (n + k) % 3 + 400 * (k in pressed) for k in range(23)] + [7]
            with contextlib.suppress(BlockingIOError):  # nobody listens
                os.write(self.end, (",".join(map(str, [20 * n, *values])) + "\n").encode())

    def stop(self):
        self.sending = False
        self.thread.join()


def check_probe(binaries, folder, browser, screenshots):
    """What a probe found and assumed is on the page, and the number of the taxel that is pressed."""
    mat = Mat()
    with contextlib.ExitStack() as stack:
        stack.callback(mat.stop)
        command = [binaries / "supertac-stream", "--sensor", mat.port, "--probe", "--seconds", "3", "--web", "0", "--out", "mat.json"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
        stack.callback(process.kill)
        time.sleep(1)
        mat.pressed = 23  # lets go
        url = next(m[1] for line in process.stderr if (m := re.search(r"live page: (\S+)", line)))
        draft = json.loads((folder / "mat.json").read_text())
        assert (draft["rows"], draft["columns"], draft["dead"]) == (4, 6, [23]), draft
        browser.look(1280, 860)
        browser.open(url)
        wait_until("what was found", lambda: "assumed: 4x6 taxels at 3 mm" in text(browser, "found-text"))
        wait_until("what to do", lambda: text(browser, "most") == "press a taxel: its number is shown here")
        for taxel, place in ((13, "row 2, column 1"), (4, "row 0, column 4")):
            mat.pressed = taxel
            wait_until("its number", lambda: text(browser, "most").startswith(f"taxel {taxel}, {place}: "))  # noqa: B023
            rest, now = map(int, re.findall(r"(\d+) at rest, (\d+) now", text(browser, "most"))[0])
            assert 395 <= now - rest <= 405, (rest, now)
            assert browser.js("return supertac.newest.felt.indexOf(Math.max(...supertac.newest.felt))") == taxel
        if screenshots:
            keep_screenshots(browser, screenshots, "probe")
        process.terminate()
        assert process.wait(60) == 143


def check_order(binaries, folder, browser, screenshots):
    """Each place of the array is pressed in turn: the file gets the order, and rest and dead follow their taxels."""
    wiring = random.Random(57).sample(range(24), 24)
    mat = Mat(wiring)
    with contextlib.ExitStack() as stack:
        stack.callback(mat.stop)
        command = [binaries / "supertac-stream", "--sensor", mat.port, "--probe", "--seconds", "3", "--web", "0", "--out", "turns.json"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, cwd=folder)
        stack.callback(process.kill)
        time.sleep(1)
        mat.pressed = set()
        url = next(m[1] for line in process.stderr if (m := re.search(r"live page: (\S+)", line)))
        before = (folder / "turns.json").read_bytes()
        draft = json.loads(before)
        assert "order" not in draft and len(draft["rest"]) == 24, draft
        browser.look(1280, 860)
        browser.open(url)
        wait_until("the page", lambda: "Press the places" in text(browser, "ask"))

        def asked():
            return browser.js("return supertac.newest.asked ?? -1")

        def press(*places):
            mat.pressed = set(places)
            top = max(range(24), key=lambda p: (p in places, -p))
            wait_until("felt", lambda: browser.js(f"return supertac.newest.felt[{wiring[top]}]") > 100)
            time.sleep(0.5)
            mat.pressed = set()
            time.sleep(0.5)

        browser.press("o")
        wait_until("the first place is asked for", lambda: asked() == 0)
        press(0)
        wait_until("the second", lambda: asked() == 1)
        browser.press("\ue00c")  # Escape
        wait_until("it is left", lambda: "turns.json is as it was" in text(browser, "ask"))
        assert (folder / "turns.json").read_bytes() == before
        browser.press("o")  # at once: the page's newest event may still ask
        time.sleep(0.5)
        for place in range(24):
            wait_until(f"place {place} is asked for", lambda: asked() == place)  # noqa: B023
            if place == 3:
                press(3, 9)
                wait_until("two at once are not taken", lambda: "answered alike: press one place alone" in text(browser, "ask"))
                assert asked() == 3
            if place == 5:
                press(2)
                wait_until("nor is one twice", lambda: "answered again, as at row 0, column 2" in text(browser, "ask"))
                assert asked() == 5
                if screenshots:
                    keep_screenshots(browser, screenshots, "order")
            if wiring[place] == 23:
                browser.press("n")
            else:
                press(place)
        wait_until("the file has it", lambda: "turns.json has the order" in text(browser, "ask"))
        found = json.loads((folder / "turns.json").read_text())
        assert found["order"] == wiring and found["dead"] == [wiring.index(23)], found
        assert found["rest"] == [draft["rest"][at] for at in wiring], found
        process.terminate()
        assert process.wait(60) == 143


def keep_screenshots(browser, folder, page="page"):
    for name, size, dark in (("light", (1280, 860), False), ("dark", (1280, 860), True), ("phone", (400, 1400), False)):
        browser.look(*size, dark)
        time.sleep(0.4)
        (folder / f"{page}_{name}.png").write_bytes(browser.screenshot())


def check_page(binaries, folder, browser, screenshots):
    with contextlib.ExitStack() as stack:
        rig = Rig(binaries, folder)
        stack.callback(rig.stop)
        log = folder / "seen.safetensors"
        stream = Stream(binaries, ["--board", rig.board], folder, log)
        stack.callback(stream.process.kill)
        browser.look(1280, 860)
        browser.open(stream.url)
        wait_until("a picture", lambda: shown(browser) > 0)
        assert text(browser, "badge") == "virtual rig"
        rig.move(SLIDES)
        wait_until("contact", lambda: felt(browser) > 0.06)
        check_changes(browser)
        seen = [check_pause(browser) for _ in range(3)]
        if screenshots:
            keep_screenshots(browser, screenshots)
        check_record(browser, folder)
        check_snapshot(browser, folder)
        wait_until("rest on the texture", lambda: felt(browser) > 0.06 and is_at_rest(browser))
        check_rezero(browser)
        colour_map = browser.js("return Array.from(supertac.hello.colours)")
        stream.stop()
        wait_until("it says what became of the run", lambda: re.match(r"done: \d+ frames in", text(browser, "link")))
        for number, colours in seen:
            expected = list(expected_colours(row_of(log.read_bytes(), "pictures", number), colour_map))
            assert len(set(expected)) > 20, f"picture {number} shows nothing"
            wrong = [i for i, pair in enumerate(zip(colours, expected)) if pair[0] != pair[1]]
            assert not wrong, f"picture {number}: pixels {wrong[:9]}: {colours[wrong[0]]}, expected {expected[wrong[0]]}"
        again = Stream(binaries, ["--board", rig.board], folder, log, int(stream.url.rsplit(":", 1)[1]))
        stack.callback(again.process.kill)
        wait_until("the page comes back by itself", lambda: text(browser, "link") == "live" and shown(browser) > 0)
        browser.press("z")
        wait_until("its buttons work", lambda: "nothing" in text(browser, "said"))
        again.stop()


def check_reports(binaries, folder, browser):
    """The pages of an evaluation and of a training: tables of their numbers, pictures, and charts with round numbers."""
    evaluate = ["--model", "model.safetensors", "--data", "data", "--limit", "500", "--report", "report.html", "--json", "scores.json"]
    subprocess.run([binaries / "supertac-evaluate", *evaluate, "--quiet"], check=True, stdout=subprocess.DEVNULL, cwd=folder)
    scores = json.loads((folder / "scores.json").read_text())
    browser.open((folder / "report.html").as_uri())
    rows = browser.js("return Array.from(document.querySelectorAll('tr'), row => Array.from(row.cells, c => c.textContent))")
    ridge = next(row for row in rows if row[0] == "ridge")
    for column, zone in ((1, "contact"), (4, "all")):
        assert ridge[column] == f"{scores['baselines']['ridge'][zone]['ssim']:.3f}", ridge
    shown = "return Array.from(document.querySelectorAll('canvas'), c => [c.getAttribute('aria-label').split(', ')[0], c.width])"
    pictures = browser.js(shown)
    assert len(pictures) == 4 * 24 and pictures[:4] == [["felt", 4], ["drawn", 16], ["true", 16], ["difference", 16]], pictures[:5]
    browser.open((folder / "model.run/report.html").as_uri())
    titles = browser.js("return Array.from(document.querySelectorAll('svg'), svg => svg.getAttribute('aria-label'))")
    assert titles[:2] == ["SSIM, linear axes", "1 - SSIM, logarithmic axes"], titles
    assert browser.js("return ticks(0.61, 1)") == [0.7, 0.8, 0.9, 1]
    assert browser.js("return ticks(0.002, 0.3, true)") == [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2]
    assert len(browser.js("return ticks(1e-9, 1e9, true)")) <= 8
    points = "[[0, .01], [1, .1], [2, 1], [3, -1], [4, NaN]]"
    svg = browser.js(f"return chart('', {{label: ''}}, {{logarithmic: true}}, {{a: {points}}})")
    heights = [float(pair.split(",")[1]) for pair in re.search('points="([^"]*)"', svg)[1].split()]
    assert len(heights) == 3 and heights[0] > heights[1], heights
    assert abs((heights[0] - heights[1]) - (heights[1] - heights[2])) < 0.21, "equal factors are equal steps"
    assert ">1.1<" not in browser.js("return chart('', {label: ''}, {most: 1}, {a: [[0, .5], [9, .99]]})")
    assert browser.js("return chart('', {label: ''}, {logarithmic: true}, {a: [[0, 0]]})") == ""
    page = (folder / "report.html").read_text()
    assert "<noscript>A script draws this page" in page
    (folder / "damaged.html").write_text(page.replace('"groups":', '"group":'))
    browser.open((folder / "damaged.html").as_uri())
    assert "This page cannot be drawn: TypeError" in text(browser, "content"), text(browser, "content")


def main():
    binaries = pathlib.Path(sys.argv[1]).resolve()
    screenshots = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
    programs = [shutil.which("chromedriver"), shutil.which("chromium")]
    if None in programs:
        print("skipped: chromium and chromium-driver are not installed")
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        quiet = {"check": True, "stdout": subprocess.DEVNULL, "cwd": folder}
        subprocess.run([binaries / "supertac-simulate", "--out", "data", "--plates", "6_Ridges", "--passes", "1", "--speeds", "10"], **quiet)
        train = ["--data", "data", "--out", "model.safetensors", "--preset", "tiny", "--split", "none", "--epochs", "1"]
        subprocess.run([binaries / "supertac-train", *train, "--stride", "64", "--quiet"], **quiet)
        make_lively(folder / "model.safetensors")
        with Browser(*programs, folder) as browser:
            check_page(binaries, folder, browser, screenshots)
            check_elements(binaries, folder, browser, screenshots)
            check_probe(binaries, folder, browser, screenshots)
            check_order(binaries, folder, browser, screenshots)
            check_reports(binaries, folder, browser)
    print("the page does what it says")
    return 0


if __name__ == "__main__":
    sys.exit(main())
