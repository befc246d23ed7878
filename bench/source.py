"""Where a line of a study's CSV comes from: the columns `command` and `commit` that bench/results.py asks for."""
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
