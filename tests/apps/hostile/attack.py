#!/usr/bin/env python3
"""Attacks the programs from outside, as users and batch systems do by accident.

attack.py BIN lines N SEED: N command lines of evil values for every option of every program.
attack.py BIN signals N SEED: N simulations, imports and trainings ended by a signal at a random moment.

Counts on stdout; 1 when anything was found, 77 when nobody but root may run what is in BIN. Run it as an ordinary user
or as root: as root the programs run as nobody, since evil values are also names of outputs.
"""
import collections
import math
import os
import pathlib
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

PATIENCE_S, HANG_S, MOST_KB = 1, 10, 1 << 20
# A command that works, on which evil is heaped; a later option replaces an earlier one.
GOOD = {
    "check": "file model data",
    "classify": "--model model --data data --epochs 1",
    "collect": "--printer /dev/null --board /dev/null --plate plain --out new --yes",
    "evaluate": "--model model --data data --split none --limit 9",
    "export": "model --onnx new.onnx",
    "import": "data --out new",
    "info": "data/good",
    "plate": "--plate plain --out new.stl",
    "simulate": "--out new --plates plain --passes 1 --trials 1 --speeds 50",
    "stream": "--model model --recording data/good",
    "train": "--data data --out new.model --epochs 1 --preset tiny",
    "rig": "--plate plain --board-link new.board --printer-link new.printer",
}
EVIL = ["", "x\ny", "\x1b[31mred", b"\xff\xfe", b"na\xff\x1b[31mme", "loop/x", "x" * 300, "y" * 5000] + """
    0 -1 1 2 nan inf 1e308 1e-308 18446744073709551616 0x10 1,,2 , plain ridges6 ridges0.0000001 ridgesinf bumps-1
    precious precious.stl data data/1 data/good model new new/er loop fifo empty link /dev/null /dev/zero /dev/full
    /proc/self/mem / . .. - -- $(touch${IFS}PWNED) `touch${IFS}PWNED` a;touch${IFS}PWNED
    q';system('touch${IFS}PWNED');x=' 4x4 16x16 window paper %s%n%x precious,precious""".split()
# By --force a user gives up what these name, and nothing else.
OUTPUTS = ("--out --json --outputs --capture --report --pictures --onnx --board-link --printer-link --mcap --map "
           "--c99").split()
KEPT = ["precious", "precious.stl", "model", "data/good"]  # what no program may change
ENDS = {128 + s for s in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)}
FINDINGS = ["crashes", "hangs", "not one line", "above 1 GB", "raw exceptions", "control codes", "shells",
            "files overwritten", "half folders"]
AS_NOBODY = {"user": 65534, "group": 65534, "extra_groups": []} if os.getuid() == 0 else {}

counts = collections.Counter({name: 0 for name in FINDINGS})


class Scratch:
    """A folder that the programs run in, and what in it is kept."""

    def __init__(self, bin_folder, path):
        self.bin, self.path = bin_folder, pathlib.Path(path)
        for name in ("data/1", "empty"):
            (self.path / name).mkdir(parents=True)
        (self.path / "loop").symlink_to("loop")
        (self.path / "link").symlink_to("precious")
        os.mkfifo(self.path / "fifo")
        self.kept = {name: b"precious" for name in KEPT[:2]}
        for name, content in self.kept.items():
            (self.path / name).write_bytes(content)
        self.give_away()

    def give_away(self):
        """To nobody, as whom the programs run."""
        for path in [self.path, *self.path.rglob("*")] if AS_NOBODY else []:
            os.chown(path, 65534, 65534, follow_symlinks=False)

    def run(self, program, words, seconds, ending=signal.SIGTERM):
        """Ends it by the signal after `seconds`; what then does not end within HANG_S hangs. Returns its code (128 and
        its signal), what it said, the kilobytes that it held, and whether it hung."""
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen([self.bin / ("supertac-" + program), *words], cwd=self.path, stderr=said,
                                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, **AS_NOBODY)
            begin, asked, hung = time.monotonic(), False, False
            while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
                took = time.monotonic() - begin
                if took > seconds and not asked:
                    asked = True
                    os.kill(process.pid, ending)
                if took > seconds + HANG_S and not hung:
                    hung = True
                    os.kill(process.pid, signal.SIGKILL)
                time.sleep(0.002)
            process.returncode = os.waitstatus_to_exitcode(ended[1])
            said.seek(0)
            code = process.returncode if process.returncode >= 0 else 128 - process.returncode
            return code, said.read().decode(errors="replace"), ended[2].ru_maxrss, hung

    def must(self, program, words):
        code, said, _, _ = self.run(program, words.split(), 60)
        if code != 0:
            raise SystemExit(f"supertac-{program} {words}: {said}")

    def given_up(self, name, words):
        """Whether these words give up the file: --force, and an output that is it, a link to it or its folder."""
        for option, value in zip(words, words[1:]) if "--force" in words else []:
            if option in OUTPUTS and isinstance(value, str):
                output = pathlib.Path(os.path.realpath(self.path / value))
                if output == self.path / name or (output != self.path and output in (self.path / name).parents):
                    return True
        return False

    def judge(self, program, words, result):
        code, said, kilobytes, hung = result

        def found(what):
            counts[what] += 1
            print(f"{what}: supertac-{program}", *(word[:60] for word in words), "\n ", said[:300], file=sys.stderr)

        if hung:
            return found("hangs")
        counts[f"exit {code}"] += 1
        if (code > 126 and code not in ENDS) or "Sanitizer" in said or "runtime error:" in said:
            found("crashes")
        errors = [line.startswith("supertac-") for line in said.splitlines()]
        if code in (1, 2) and (errors.count(True) != 1 or not errors[-1]):
            found("not one line")  # remarks may stand before it
        if kilobytes > MOST_KB:
            found("above 1 GB")
        if re.search(r"what\(\):|filesystem error|\[json\.|std::|basic_string|terminate called", said):
            found("raw exceptions")
        if "\x1b" in said:
            found("control codes")
        if (self.path / "PWNED").exists():
            found("shells")
            (self.path / "PWNED").unlink()
        for name, content in self.kept.items():
            file = self.path / name
            if file.is_file() and file.stat().st_size == len(content) and file.read_bytes() == content:
                continue
            if not self.given_up(name, words):
                found("files overwritten")
            remove(file)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(content)
            self.give_away()


def remove(path):
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def lines(scratch, n, seed):
    options = {}
    for program in GOOD:
        text = subprocess.run([scratch.bin / ("supertac-" + program), "--help"], capture_output=True, text=True).stdout
        options[program] = re.findall(r"^\s+(?:-h, )?(--[a-z0-9-]+)( [A-Z]\S*)?", text, re.MULTILINE)
    for i in range(n):
        dice = random.Random(f"{seed} {i}")
        program = list(GOOD)[i % len(GOOD)]
        words = GOOD[program].split() if dice.random() < 0.75 else []
        for option, value in dice.choices(options[program], k=dice.randint(1, 3)):
            if option != "--help" or dice.random() < 0.1:
                words += [option] + ([dice.choice(EVIL)] if value else [])
        if dice.random() < 0.25:
            words.append(dice.choice(EVIL))
        if dice.random() < 0.25:
            words.append("--force")
        counts["command lines"] += 1
        scratch.judge(program, words, scratch.run(program, words, PATIENCE_S))
        for path in scratch.path.glob("new*"):
            remove(path)


def names_in(folder):
    return {path.relative_to(folder) for path in folder.rglob("*")}


def signals(scratch, n, seed):
    for trial in ("1", "2"):  # text files of a collection
        folder = scratch.path / "texts/6_Ridges" / trial
        folder.mkdir(parents=True)
        rows = ("".join(f"{2.4 - 0.1 * abs(math.sin(0.01 * i + k)):.6g} " for k in range(16)) for i in range(4000))
        text = "\n".join(rows)
        for number in range(1, 5):
            (folder / f"{number}.txt").write_text(text)
    scratch.give_away()
    # Some tenths of a second for each kind of output.
    commands = [("simulate", "--plates ridges6"), ("import", "texts --skip-bad"),
                ("train", "--data whole0 --preset tiny --epochs 1 --split none --stride 64")]
    for k, (program, words) in enumerate(commands):
        scratch.must(program, f"{words} --out whole{k}")
    for i in range(n):
        dice = random.Random(f"{seed} {i}")
        k = i % len(commands)
        program, words = commands[k][0], [*commands[k][1].split(), "--out", f"signals{i}"]
        ending = dice.choice([signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
        counts["signals"] += 1
        scratch.judge(program, words, scratch.run(program, words, 0.4 * dice.random(), ending))
        # A signal may come when the folder has its name already: the folder is then whole.
        out = scratch.path / f"signals{i}"
        if out.is_dir() and names_in(out) != names_in(scratch.path / f"whole{k}"):
            counts["half folders"] += 1
            print(f"half a folder: {out} of supertac-{program}", file=sys.stderr)
        remove(out)
        remove(scratch.path / f"signals{i}.run")


def main(bin_folder, mode, n, seed):
    for ending in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):  # a script's background leaves some ignored
        signal.signal(ending, signal.SIG_DFL)
    with tempfile.TemporaryDirectory() as folder:
        scratch = Scratch(pathlib.Path(bin_folder).resolve(), os.path.realpath(folder))
        try:
            scratch.must("info", "--version")
        except PermissionError:
            print("skipped: nobody but root may run what is in", bin_folder, file=sys.stderr)
            return 77
        scratch.must("simulate", "--out data --plates plain --passes 1 --trials 1 --speeds 10")
        (scratch.path / "data/plain_t1_p1_v10.safetensors").rename(scratch.path / "data/good")
        scratch.must("simulate", "--out felt --plates ridges6 --passes 1 --trials 1")
        scratch.must("train", "--data felt --out model --preset tiny --split none --epochs 1 --stride 64")
        scratch.kept = {name: (scratch.path / name).read_bytes() for name in KEPT}
        {"lines": lines, "signals": signals}[mode](scratch, int(n), seed)
    for name, count in counts.items():
        print(f"{name},{count}")
    return int(any(counts[name] for name in FINDINGS))


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[2] not in ("lines", "signals"):
        sys.exit(__doc__)
    sys.exit(main(*sys.argv[1:]))
