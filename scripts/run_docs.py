#!/usr/bin/env python3
"""Runs the code blocks of README and docs, and checks the paths that pages name.

    scripts/run_docs.py BUILD [PAGE ...]     runs the blocks of the pages with BUILD's programs
                                             (without names: README.md, docs/*.md, examples/README.md)
    scripts/run_docs.py --check              runs nothing; looks at paths, marks, and lengths of lines, cells and pages

A comment before a block, which a reader of the page does not see, says what is done with it:

    <!-- run -->                      with sh; the blocks of a page run one after another in one scratch folder
    <!-- run; A => B; C => D -->      the same with text A replaced by B: what takes long is shortened
    <!-- run real; ... -->            only where SUPERTAC_RECORDINGS names the folder of the real recordings, here $TEXT_DIR
    <!-- run python; ... -->          as doctest; only where python3 has the package safetensors
    <!-- run after python; ... -->    as run, on what such a block has written
    <!-- not run: WHY -->             not at all

Every block without a language needs one.
"""

import importlib.util
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(?:<!-- ((?:not )?run\b.*?) -->\n)?```([a-z+]*)\n(.*?)```\n", re.DOTALL)
LONGEST_LINE, LONGEST_CELL, MOST_README_LINES, MOST_README_ROWS, MOST_RESULTS_WORDS = 120, 120, 120, 4, 9000
# What a page may name although it is not in the tree: what programs make, and names that stand for others.
MADE = re.compile(r"^(out/|build|yours/\d)|^(scores|sweep|model)\.|NAME|JOB")
FILE = re.compile(r"`([\w./+-]+\.(?:cpp|h|inl|md|py|sh|gp|cmake|csv|png|svg|txt))`|\]\(([^)#: ]+)\)")


def pages():
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), ROOT / "examples/README.md"]


def tracked_files():
    """Paths of all files below ROOT, but for what git ignores."""
    found = set()
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [f for f in folders if not f.startswith(("build", ".git", "__pycache__")) and f != "out"]
        found.update((pathlib.Path(folder) / name).relative_to(ROOT).as_posix() for name in names)
    return found


def missing_paths(page, files):
    if page.name == "CHANGELOG.md":  # it names what was
        return
    folder = page.parent.relative_to(ROOT)
    for match in FILE.finditer(re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)):
        path = match[1] or match[2]
        near = os.path.normpath(folder / path)
        ends = any(f"/{file}".endswith(f"/{path}") for file in files)
        if not (ends or near in files or (ROOT / near).is_dir() or MADE.search(path)):
            yield f"{page.relative_to(ROOT)} names {path}, which is not in the tree"


def long_lines(page):
    for number, line in enumerate(page.read_text().splitlines(), 1):
        if len(line) > LONGEST_LINE and not line.startswith(("|", "<!--", "!")):
            yield f"{page.relative_to(ROOT)}:{number}: {len(line)} characters, expected at most {LONGEST_LINE}"


def long_cells(page):
    for number, line in enumerate(page.read_text().splitlines(), 1):
        longest = max(map(len, map(str.strip, line.split("|"))), default=0) if line.startswith("|") else 0
        if longest > LONGEST_CELL:
            yield f"{page.relative_to(ROOT)}:{number}: a cell of {longest} characters, expected at most {LONGEST_CELL}"


def sizes():
    """What the words may weigh: (what, how much, how much at most)."""
    readme = (ROOT / "README.md").read_text()
    reached = re.search(r"<!-- beside_the_paper -->\n(.*?)<!--", readme, re.DOTALL)[1]
    results = sum(len(page.read_text().split()) for page in (ROOT / "bench/results").rglob("*.md"))
    return [("lines of README.md", len(readme.splitlines()), MOST_README_LINES),
            ("rows of README's table of what is reached", len(reached.splitlines()) - 2, MOST_README_ROWS),
            ("words of bench/results", results, MOST_RESULTS_WORDS)]


def unmarked(page):
    for mark, language, text in BLOCK.findall(page.read_text()):
        if not mark and not language:
            yield f"{page.relative_to(ROOT)}: the block '{text.splitlines()[0]}' says neither run nor not run"


def check():
    files = tracked_files()
    complaints = []
    for page in sorted(ROOT / path for path in files if path.endswith(".md")):
        complaints += missing_paths(page, files)
        complaints += long_lines(page)
        complaints += long_cells(page)
    for page in pages():
        complaints += unmarked(page)
    for what, found, most in sizes():
        print(f"{what}: {found} of {most}")
        if found > most:
            complaints.append(f"{what}: {found}, expected at most {most}")
    return complaints


def replaced(text, changes, page):
    for change in changes:
        old, new = change.split(" => ")
        if old not in text:
            sys.exit(f"run_docs.py: {page.name}: the block holds no '{old}' to be replaced")
        text = text.replace(old, new)
    return text


def run(command, folder, environment):
    """Runs it in a process group of its own, of which nothing is left behind."""
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            process.wait(timeout=300)
        except subprocess.TimeoutExpired:
            output.write("it did not end within 300 s")
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        output.seek(0)
        return process.wait(), output.read()


def command_of(kind, texts, folder):
    if kind == "run python":
        (folder / "block.txt").write_text("\n".join(texts) + "\n")
        return [sys.executable, "-m", "doctest", "block.txt"]
    return ["sh", "-euc", "\n".join(texts)]


def run_page(page, environment):
    """Runs the page's blocks; neighbours of one kind together. Returns whether all went well."""
    groups = []
    for mark, _, text in BLOCK.findall(page.read_text()):
        kind, *changes = [part.strip() for part in mark.split(";")]
        if not kind.startswith("run"):
            continue
        text = replaced(text, changes, page)
        if groups and groups[-1][0] == kind:
            groups[-1][1].append(text)
        else:
            groups.append((kind, [text]))
    well = True
    with tempfile.TemporaryDirectory() as scratch:
        for kind, texts in groups:
            about = f"{page.relative_to(ROOT)}: {len(texts)} blocks '{kind}'"
            if kind == "run real" and "TEXT_DIR" not in environment:
                print(f"{about} not run: SUPERTAC_RECORDINGS is not set")
            elif kind.endswith("python") and importlib.util.find_spec("safetensors") is None:
                print(f"{about} not run: python3 has no package safetensors")
            else:
                begin = time.monotonic()
                code, output = run(command_of(kind, texts, pathlib.Path(scratch)), scratch, environment)
                print(f"{about} {'ran' if code == 0 else 'FAILED'}, {time.monotonic() - begin:.1f} s")
                if code != 0:
                    print("".join(texts) + "--- gave, with exit code", code, "---\n" + output)
                    well = False
    return well


def main():
    if sys.argv[1:] == ["--check"]:
        complaints = check()
        for complaint in complaints:
            print(f"run_docs.py: {complaint}", file=sys.stderr)
        sys.exit(1 if complaints else 0)
    if len(sys.argv) < 2 or not (pathlib.Path(sys.argv[1]) / "bin").is_dir():
        sys.exit(__doc__)
    build = pathlib.Path(sys.argv[1]).resolve()
    environment = dict(os.environ, ROOT=str(ROOT), PATH=f"{build}/bin:{build}/examples:{os.environ['PATH']}")
    if environment.get("SUPERTAC_RECORDINGS"):
        environment["TEXT_DIR"] = environment["SUPERTAC_RECORDINGS"]
    chosen = [pathlib.Path(page).resolve() for page in sys.argv[2:]] or pages()
    sys.exit(0 if all([run_page(page, environment) for page in chosen]) else 1)


if __name__ == "__main__":
    main()
