#!/usr/bin/env python3
"""Checks every #include of the sources against the arrows that the READMEs name.

Arrows between folders stand in README.md, those between the rooms of a folder in its own README, as in
`io <- data <- models` (models may use data, and what data may use). A script, since a wrong arrow between headers links.
Errors: an include of a file that is not there; an arrow that no README names; rooms in a circle; a folder of more than 20
files. Exit code 1, a line for each.
    scripts/check_includes.py
"""
import collections
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
FOLDERS = ("io", "autograd", "layers", "data", "models", "hardware", "apps")
WITH_ROOMS = ("io", "data", "models", "hardware", "apps")
USERS = ("tests", "bench", "examples", "docs", "library", "python")  # may use everything
MADE_BY_THE_BUILD = ("programs.inc", "glossary.inc", "c99_text.h")
MOST_FILES = 20


def tracked():
    names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True,
                           check=True).stdout.split("\n")
    return {name for name in names if name and (ROOT / name).exists()}


def arrows(readme, prefix=""):
    """May-use pairs of the chains `a, b <- c` in a README, each name under `prefix`."""
    pairs = set()
    for text in re.findall(r"[\w/]+(?:, [\w/]+)*(?: <- [\w/]+(?:, [\w/]+)*)+", (ROOT / readme).read_text()):
        links = [[prefix + name for name in link.split(", ")] for link in text.split(" <- ")]
        pairs |= {(right, left) for lefts, rights in zip(links, links[1:]) for right in rights for left in lefts}
    return pairs


def reach(pairs, start):
    found, left = {start}, [start]
    while left:
        at = left.pop()
        new = {b for a, b in pairs if a == at} - found
        found |= new
        left += new
    return found


def room_of(path):
    parts = path.split("/")
    return "/".join(parts[:2]) if parts[0] in WITH_ROOMS and len(parts) > 2 else parts[0]


def includes(files):
    for name in sorted(files):
        if name.endswith((".h", ".cpp", ".inl", ".in")) and name.split("/")[0] in FOLDERS + USERS:
            for found in re.findall(r'^\s*#\s*include "([^"]+)"', (ROOT / name).read_text(), re.M):
                yield name, found


def main():
    files = tracked()
    between = arrows("README.md")
    inside = {pair for folder in WITH_ROOMS for pair in arrows(folder + "/README.md", folder + "/")}
    errors, uses = {}, collections.defaultdict(set)
    for name, target in includes(files):
        known = any(file == target or file.endswith("/" + target) for file in files)
        if not known and not target.startswith("supertac/") and target not in MADE_BY_THE_BUILD:
            errors[f"{name}: includes {target}, which is not there"] = ""
        here, there = room_of(name), room_of(target)
        if here == there or target not in files or here.split("/")[0] in USERS:
            continue
        uses[here].add(there)
        folder, other = here.split("/")[0], there.split("/")[0]
        if folder != other:
            allowed = {other, there} & (reach(between, folder) | reach(between, here))
        else:
            allowed = here == folder or there in reach(inside, here)  # programs use every room of apps
        if not allowed:
            errors[f"{here} -> {there}"] = f", as {name} includes {target}; no README names this arrow"
    pairs = {(a, b) for a, all_b in uses.items() for b in all_b}
    loops = {frozenset(x for x in reach(pairs, room) if room in reach(pairs, x)) for room in uses}
    errors |= {"circle: " + ", ".join(sorted(loop)): "" for loop in loops if len(loop) > 1}
    floors = collections.Counter(str(pathlib.Path(name).parent) for name in files)
    errors |= {f"floor: {folder}": f" has {count} files, expected at most {MOST_FILES}"
               for folder, count in floors.items() if count > MOST_FILES}
    lines = [error + why for error, why in sorted(errors.items())]
    print("\n".join(lines) or f"{len(uses)} rooms and folders, {len(pairs)} arrows")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main())
