#!/usr/bin/env python3
"""Looks at what is packaged beside the programs of a build: the list of what they link, completion, man pages.

    tests/packaging/check.py BUILD

77 where this is no Debian.
"""
import gzip
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parents[2] / "packaging"
build = pathlib.Path(sys.argv[1]).resolve()
if shutil.which("dpkg-query") is None or shutil.which("bash") is None:
    print("skipped: no dpkg-query or no bash")
    sys.exit(77)


def expect(holds, what):
    if not holds:
        sys.exit(f"check.py: {what}")


def bill(*models):
    words = [sys.executable, HERE / "sbom.py", build / "bin", *models, "--version", "0"]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout


def validated(text):
    """Whether CycloneDX's schema could be asked: pip install cyclonedx-python-lib[validation]."""
    try:
        from cyclonedx.schema import SchemaVersion
        from cyclonedx.validation.json import JsonStrictValidator
    except ImportError:
        return False
    error = JsonStrictValidator(SchemaVersion.V1_5).validate_str(text)
    expect(error is None, f"CycloneDX 1.5 refuses the list: {error}")
    return True


def bill_with_a_model(folder):
    """The list with the card of a model that this trains."""
    def run(program, *words):
        subprocess.run([build / "bin" / program, *words, "--quiet"], check=True, stdout=subprocess.DEVNULL)

    run("supertac-simulate", "--out", f"{folder}/d", "--plates", "6_Ridges", "--passes", "1", "--speeds", "10")
    run("supertac-train", "--data", f"{folder}/d", "--out", f"{folder}/m.safetensors", "--preset", "tiny", "--split", "none",
        "--epochs", "1", "--stride", "64")
    return bill(f"{folder}/m.safetensors")


def completed(program, *words):
    script = ('source "$1"; shift; COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)); _supertac "$1"; '
              'printf "%s\\n" "${COMPREPLY[@]}"')
    path = {"PATH": f"{build / 'bin'}:{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script, "_", HERE / "completion.bash", program, *words], capture_output=True,
                          text=True, env=os.environ | path)
    return done.stdout.split()


text = bill()
expect(text == bill(), "two lists of the same programs differ")
with tempfile.TemporaryDirectory() as folder:
    with_model = bill_with_a_model(folder)
card = next(part for part in json.loads(with_model)["components"] if part["type"] == "machine-learning-model")
said = {entry["name"]: entry["value"] for entry in card["properties"]}
expect("recordings" in said["supertac:provenance"], "the model's card does not say what it was trained on")
asked = validated(text) and validated(with_model)
parts = {entry["ref"]: " ".join(entry["dependsOn"]) for entry in json.loads(text)["dependencies"]}
expect("libstdc%2B%2B6" in parts["supertac-info"] or "libstdc++6" in parts["supertac-info"], "supertac-info links no C++")
expect("microhttpd" in parts["supertac-stream"], "supertac-stream links libmicrohttpd, the list does not say so")
expect("microhttpd" not in parts["supertac-info"], "supertac-info does not link libmicrohttpd, the list says so")
jobs = [path.name.removeprefix("supertac-") for path in (build / "bin").glob("supertac-*") if path.name.count("-") == 1]
expect(set(jobs) <= set(completed("supertac", "")), "completion does not know every job")
expect(completed("supertac", "simu") == ["simulate"], "supertac simu<TAB>")
expect(completed("supertac", "train", "--pres") == ["--preset"], "supertac train --pres<TAB>")
expect(completed("supertac-train", "--pres") == ["--preset"], "supertac-train --pres<TAB>")
pages = build / "share/man"
if shutil.which("help2man"):
    for job in set(jobs) - {"sweep"}:
        page = gzip.decompress((pages / f"supertac-{job}.1.gz").read_bytes()).decode()
        expect("\\-\\-json" in page and ".SH NAME" in page, f"the man page of {job} lacks its options")
print("CycloneDX's schema accepts the list" if asked else "cyclonedx is not installed: its schema was not asked")
print(f"{len(parts)} programs listed, {len(jobs)} completed" + (f", {len(list(pages.glob('*.1.gz')))} man pages" if pages.exists() else ""))
