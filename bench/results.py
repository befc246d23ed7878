#!/usr/bin/env python3
"""Writes the tables of README.md and of the pages in bench/results from the CSV files beside them.

    bench/results.py            rewrites what stands between <!-- NAME --> and <!-- /NAME -->
    bench/results.py --check    changes nothing; exit code 1 and one line for everything that is stale

A table's name is that of its function in bench/tables.py, or of its item in bench/paper. Every CSV has the columns `command` and `commit`, which say how
its lines were made; where they are empty those of the line above hold.
"""
import functools
import pathlib
import re
import subprocess
import sys

import tables

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "bench/paper"))
from figure7 import figure7  # noqa: E402
from figure8 import figure8  # noqa: E402
from figure10 import figure10  # noqa: E402
from figure11 import figure11  # noqa: E402
from table1 import table1, table1_tests  # noqa: E402
from table2 import table2, table2_tests  # noqa: E402

TABLES = {
    "README.md": [tables.beside_the_paper, tables.fastest],
    "bench/results/accuracy.md": [tables.reached, tables.aligned, tables.first_contact, tables.demo],
    "docs/map.md": [tables.later, tables.shown_elements, tables.maps],
    "docs/paper.md": [table1, table1_tests, table2, table2_tests, figure7, figure8, figure10, figure11],
    "bench/results/unseen_plates.md": [tables.left_out],
    "bench/results/sensors.md": [tables.other_sensors, tables.few_shot],
    "bench/results/sensor_faults.md": [tables.corruptions, tables.silence],
    "bench/results/speed.md": [tables.speed, tables.tail, tables.cold_start, tables.threads,
                               tables.fast_parts, tables.whole_job, tables.precision],
    "bench/results/reliability.md": [tables.studies],
    "bench/results/parts.md": [tables.parts, tables.simulator_terms, tables.tried],
}


def rewritten(page):
    text = (ROOT / page).read_text()
    for section in TABLES[page]:
        name = section.__name__
        new = f"<!-- {name} -->\n{section()}\n<!-- /{name} -->"
        text, count = re.subn(f"<!-- {name} -->.*<!-- /{name} -->", lambda _: new, text, flags=re.DOTALL)
        if count != 1:
            sys.exit(f"results.py: {page} has no lines <!-- {name} --> and <!-- /{name} -->")
    return text


def without_source():
    """What a CSV of the results does not say of itself, and CSVs that no page names."""
    pages = "".join(path.read_text() for path in [*tables.RESULTS.glob("*.md"), *(ROOT / "docs").glob("*.md")])
    for path in sorted(tables.RESULTS.rglob("*.csv")):
        name = path.relative_to(tables.RESULTS).as_posix()
        if name not in pages:
            yield f"bench/results/{name} is named by no page of bench/results or docs"
        for number, row in enumerate(tables.rows(name), 2):
            if not row.get("command") or not re.fullmatch("[0-9a-f]{7,40}", row.get("commit") or ""):
                yield f"bench/results/{name}:{number}: columns `command` and `commit` must say how it was made"
                break
            for script in re.findall(r"\S+\.(?:py|sh)\b", row["command"]):
                if in_git(row["commit"]) and not in_git(f"{row['commit']}:{script}"):
                    yield f"bench/results/{name}:{number}: {script} is not in commit {row['commit']}"


@functools.cache
def in_git(name):
    """Whether this clone has such a commit, or file of a commit."""
    return subprocess.run(["git", "-C", ROOT, "cat-file", "-e", name], capture_output=True).returncode == 0


def main():
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    complaints = list(without_source())
    for page in TABLES:
        text = rewritten(page)
        if text == (ROOT / page).read_text():
            continue
        if sys.argv[1:]:
            complaints.append(f"{page} is older than the CSV files: run bench/results.py")
        else:
            (ROOT / page).write_text(text)
    for complaint in complaints:
        print(f"results.py: {complaint}", file=sys.stderr)
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
