#!/usr/bin/env python3
"""Looks at what is packaged beside the programs of a build: the list of what they link, completion, man pages.

    packaging/check.py BUILD

77 where this is no Debian.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
build = pathlib.Path(sys.argv[1]).resolve()
if shutil.which("dpkg-query") is None or shutil.which("bash") is None:
    print("skipped: no dpkg-query or no bash")
    sys.exit(77)


def expect(holds, what):
    if not holds:
        sys.exit(f"check.py: {what}")


def bill():
    words = [sys.executable, HERE / "sbom.py", build / "bin", "--version", "0"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def completed(program, *words):
    script = ('source "$1"; shift; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _supertac "$1"; '
              'printf "%s\\n" "${COMPREPLY[@]}"')
    path = {"PATH": f"{build / 'bin'}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script, "_", HERE / "completion.bash", program, *words], capture_output=True,
                          text=True, env=os.environ | path)
    return done.stdout.split()


text = bill()
expect(text == bill(), "two lists of the same programs differ")
parts = {entry["ref"]: " ".join(entry["dependsOn"]) for entry in json.loads(text)["dependencies"]}
expect("libstdc%2B%2B6" in parts["supertac-info"] or "libstdc++6" in parts["supertac-info"], "supertac-info links no C++")
expect("openblas" in parts["supertac-evaluate"], "supertac-evaluate links OpenBLAS, the list does not say so")
expect("openblas" not in parts["supertac-info"], "supertac-info does not link OpenBLAS, the list says so")
jobs = [path.name.removeprefix("supertac-") for path in (build / "bin").glob("supertac-*") if path.name.count("-") == 1]
expect(set(jobs) <= set(completed("supertac", "")), "completion does not know every job")
expect(completed("supertac", "simu") == ["simulate"], "supertac simu<TAB>")
expect(completed("supertac", "train", "--pres") == ["--preset"], "supertac train --pres<TAB>")
expect(completed("supertac-train", "--pres") == ["--preset"], "supertac-train --pres<TAB>")
pages = build / "share/man"
if shutil.which("help2man"):
    for job in jobs:
        page = (pages / f"supertac-{job}.1").read_text()
        expect("\\-\\-json" in page and ".SH NAME" in page, f"the man page of {job} lacks its options")
print(f"{len(parts)} programs listed, {len(jobs)} completed" + (f", {len(list(pages.glob('*.1')))} man pages" if pages.exists() else ""))
