"""Lines of a study's CSV, and where they come from: the columns `command` and `commit` that bench/results.py asks for."""
import csv
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]


def source():
    """A changed working tree is said to be one, and is refused by bench/results.py."""
    git = ["git", "-C", ROOT, "describe", "--always", "--abbrev=7", "--exclude=*", "--dirty"]
    commit = subprocess.run(git, capture_output=True, text=True).stdout.strip()
    program = pathlib.Path(sys.argv[0]).resolve().relative_to(ROOT).as_posix()
    words = [re.sub(r"(^|[=,])/[^,\s]*/", r"\1", word) for word in sys.argv[1:]]  # no paths of a machine
    return {"command": " ".join([program, *words]), "commit": commit or "unknown"}


def commit_of(program):
    """The commit that a program of ours was built from."""
    told = subprocess.run([program, "--version"], capture_output=True, text=True).stdout
    return told.split("commit")[1].split()[0]


def write_csv(path, lines, columns=None):
    """Dictionaries as lines; `columns`: those of the first line unless given."""
    with open(path, "w", newline="") as file:
        table = csv.DictWriter(file, columns or list(lines[0]), restval="", lineterminator="\n")
        table.writeheader()
        table.writerows(lines)


def write(path, lines):
    """The lines with their source, which stands in the first of them and holds for all."""
    made = source()  # before the file changes the tree
    shown = [{key: f"{value:.4g}" if isinstance(value, float) else value for key, value in line.items()} for line in lines]
    write_csv(path, [shown[0] | made, *shown[1:]])


def keep(path, columns, keys, line):
    """The line in the place of an older one with the same keys."""
    lines = []
    if path.exists():
        with open(path, newline="") as file:
            lines = [old for old in csv.DictReader(file) if any(old[key] != str(line[key]) for key in keys)]
    write_csv(path, [*lines, line], columns)
