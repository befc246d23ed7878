#!/usr/bin/env python3
"""Writes the tables of the pages in bench/results from the CSV files beside them, and the README's from those pages.

    bench/results.py            rewrites what stands between <!-- NAME --> and <!-- /NAME -->
    bench/results.py --check    changes nothing; exit code 1 and one line for everything that is stale

The functions that make a page's tables are in the module of its name in bench/tables, a table's name is its function's.
bench/results/sources.csv says of every file how it was made; a file that it does not name is an error. The README's
tables are those of the pages with some lines left out.
"""
import pathlib
import re
import sys

from tables import accuracy, never_felt, reliability, simulated_fingers, speed, training, whole_passes
from tables.figures import RESULTS, rows, table

ROOT = pathlib.Path(__file__).resolve().parents[1]
README, INDEX = ROOT / "README.md", RESULTS / "README.md"


def sources():
    found = rows("sources.csv")
    return table(["file", "command", "commit", "split", "seeds", "date"],
                 [[f"`{r['file']}`", r["command"], r["commit"], r["split"], r["seeds"], r["date"]] for r in found])


PAGES = {INDEX: [sources], README: [whole_passes.reached, speed.speed]}
for page in (accuracy, speed, training, reliability, never_felt, simulated_fingers, whole_passes):
    PAGES[RESULTS / f"{page.__name__.split('.')[-1]}.md"] = page.TABLES


# Lines of the pages' tables that the README leaves out.
NOT_IN_README = re.compile(r"^\| (mean image|(inference|in int8)[^|]*\| [^|]* \| (pytorch eager|onnx runtime|onnx runtime int8|openvino int8) [\d.]+ |[^|]*batch 8 |[^|]*\| [^|]* \| torch\.compile ).*\n", re.MULTILINE)


def rewritten(path):
    text = path.read_text()
    for section in PAGES[path]:
        name, body = section.__name__, section()
        if path == README:
            body = NOT_IN_README.sub("", body)
        new = f"<!-- {name} -->\n{body}\n<!-- /{name} -->"
        text, count = re.subn(f"<!-- {name} -->.*<!-- /{name} -->", lambda _: new, text, flags=re.DOTALL)
        if count != 1:
            sys.exit(f"results.py: {path.relative_to(ROOT)} has no lines <!-- {name} --> and <!-- /{name} -->")
    return text


def unnamed():
    """Files of results that sources.csv does not name, and the other way round."""
    named = {name.strip(" `") for r in rows("sources.csv") for name in r["file"].split(",")}
    ours = {str(path.relative_to(RESULTS)) for path in PAGES if path.is_relative_to(RESULTS)} | {"sources.csv"}
    present = {str(path.relative_to(RESULTS)) for path in RESULTS.rglob("*") if path.is_file()} - ours
    return ([f"bench/results/{name} has no line in sources.csv: say command, commit, split, seeds and date" for name in sorted(present - named)] +
            [f"sources.csv names {name}, which is not in bench/results" for name in sorted(named - present)])


def main():
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    complaints = unnamed()
    for path in PAGES:
        text = rewritten(path)
        if text != path.read_text():
            if sys.argv[1:]:
                complaints.append(f"{path.relative_to(ROOT)} is older than the CSV files: run bench/results.py")
            else:
                path.write_text(text)
    for complaint in complaints:
        print(f"results.py: {complaint}", file=sys.stderr)
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
