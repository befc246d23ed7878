#!/usr/bin/env python3
"""Checks the lines of C++ (h, cpp, inl) of every room against scripts/budget.txt.

Only an issue may raise a budget: new code replaces old. Exit code 1, a line for each room that is over it or has none.
    scripts/check_budget.py          checks
    scripts/check_budget.py --set    writes what stands, plus 2 %
"""
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUDGET = ROOT / "scripts/budget.txt"
HEAD = "# Room and the most lines of C++ (h, cpp, inl) that it may have; scripts/check_budget.py.\n"


def room_of(name):
    folder = name.split("/")[:-1]
    return folder[0] if folder[0] == "tests" else "/".join(folder[:2])


def counted():
    names = subprocess.run(["git", "ls-files", "*.h", "*.cpp", "*.inl"], cwd=ROOT, capture_output=True, text=True, check=True)
    rooms = {}
    for name in names.stdout.split("\n"):
        if name and (ROOT / name).exists():
            room = room_of(name)
            rooms[room] = rooms.get(room, 0) + len((ROOT / name).read_text().splitlines())
    return rooms


def main():
    rooms = counted()
    if sys.argv[1:] == ["--set"]:
        BUDGET.write_text(HEAD + "".join(f"{room} {-(-lines * 102 // 100)}\n" for room, lines in sorted(rooms.items())))
    budget = dict(line.split() for line in BUDGET.read_text().splitlines() if not line.startswith("#"))
    wrong = [f"{room}: {lines} lines, expected at most {budget.get(room, 'a line in scripts/budget.txt')}"
             for room, lines in sorted(rooms.items()) if lines > int(budget.get(room, 0))]
    print("\n".join(wrong) or f"{sum(rooms.values())} lines in {len(rooms)} rooms, {rooms['tests']} of them tests")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
