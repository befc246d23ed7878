#!/usr/bin/env python3
"""The lessons: engines from the pieces of examples/mini_supertac.cpp, and proofs that the checks find mistakes.

    lessons.py stubs                          writes the pieces with their holes (holes.txt) to yours/, where there are none
    lessons.py engine N PIECE OUT [--mine]    writes OUT: pieces 1 to N - 1 of the file, or of the reader, and PIECE
    lessons.py prove CXX [N ...]              every stub fails and names an entry, every solution passes, and each
                                              mistake of planted.txt is found and named; of lessons N only. What
                                              the README shows of a stub is what it says
"""
import pathlib
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
MINI = (ROOT / "examples/mini_supertac.cpp").read_text()
STUBS = [HERE.parent / "yours" / (page.stem + ".h") for page in sorted(HERE.parent.glob("[0-9][0-9]_*.md"))]


def pieces():
    marks = [m.start() for m in re.finditer(r"^// ---- \d+\.", MINI, re.M)] + [len(MINI)]
    return [MINI[a:b] for a, b in zip(marks, marks[1:])] + [(HERE / "12_break_it.h").read_text()]


def paragraphs(name):
    """Those of a text file here, as lines without comments."""
    for paragraph in (HERE / name).read_text().split("\n\n"):
        if lines := [line for line in paragraph.splitlines() if line and not line.startswith("#")]:
            yield lines


def stub(n):
    """Piece n with its holes."""
    text = pieces()[n - 1].rstrip("\n") + "\n"
    for number, *lines in paragraphs("holes.txt"):
        out, into = ("".join(line[1:] + "\n" for line in lines if line[0] == sign) for sign in "-+")
        if int(number) == n:
            if text.count(out) != 1:
                sys.exit(f"holes.txt: piece {n} does not have once:\n{out}")
            text = text.replace(out, into)
    return text


def write_stubs():
    for n, path in enumerate(STUBS, 1):
        if not path.exists():
            path.write_text(stub(n))


def engine(n, piece, out, mine=False):
    head = "".join(line + "\n" for line in MINI.splitlines() if line.startswith("#include"))
    before = [stub.read_text() for stub in STUBS[: n - 1]] if mine else pieces()[: n - 1]
    text = head + "#define main mini_main\n" + "".join(before) + f'#include "{piece}"\n#undef main\n'
    pathlib.Path(out).write_text("#pragma once\n" + text)


def build(n, variants, compiler, folder):
    """One program for lesson n that checks the k-th variant of its piece when it is called with k."""
    text = (HERE / "check.cpp").read_text()
    head = "".join(line + "\n" for line in (MINI + text).splitlines() if line.startswith("#include <"))
    body = text[text.index("namespace {") : text.index("int main()")]
    out = head + '#include "docs/lessons/check/checker.h"\n#define main mini_main\n'
    for k, variant in enumerate(variants):
        out += f"namespace variant{k} {{\n" + "".join(pieces()[: n - 1]) + variant + body + "}\n"
    calls = "".join(f"  if (k == {k}) variant{k}::check(report);\n" for k in range(len(variants)))
    out += f"""#undef main
int main(int, char** arguments) {{
  const int k = std::atoi(arguments[1]);
  lessons::name_aborts("lesson {n}");
  lessons::Report report;
{calls}  std::puts(report.wrong() == 0 ? "  passed" : "  not yet");
  return report.wrong() == 0 ? 0 : 1;
}}
"""
    stem = pathlib.Path(folder) / f"lesson{n}"
    stem.with_suffix(".cpp").write_text(out)
    subprocess.run([compiler, "-std=c++20", "-O0", "-w", "-D_GLIBCXX_ASSERTIONS",
                    f"-DLESSON={n}", f"-I{ROOT}", f"{stem}.cpp", "-o", stem], check=True)
    return stem


def planted():
    """(lesson, old, new, expected) of each paragraph of planted.txt."""
    for n, old, new, expected in paragraphs("planted.txt"):
        yield int(n), old, new, expected


def quoted(n):
    """What the README shows of a stub's output."""
    found = re.search(rf"```text\nlesson {n}\n(.*?)```", (HERE.parent / "README.md").read_text(), re.S)
    return " ".join(found.group(1).split()) if found else ""


def prove(compiler, *only):
    solutions, jobs = pieces(), {}
    for n, solution in enumerate(solutions, 1):
        if only and str(n) not in only:
            continue
        jobs[n] = [("solution", solution, 0, "passed"),
                   ("stub", stub(n), 1, r"wrong: .*yours -?[0-9.e+-]+, ")]
    for n, old, new, expected in planted():
        if n not in jobs:
            continue
        if solutions[n - 1].count(old) < 1:
            sys.exit(f"planted.txt: lesson {n} has no '{old}'")
        jobs[n].append((f"'{new}'", solutions[n - 1].replace(old, new, 1), 1, expected))

    def prove_lesson(n):
        program = build(n, [text for _, text, _, _ in jobs[n]], compiler, folder)
        done = []
        for k, (name, _, code, expected) in enumerate(jobs[n]):
            ran = subprocess.run([program, str(k)], capture_output=True, text=True, timeout=600)
            text = ran.stdout + ran.stderr
            good = ran.returncode == code and re.search(expected, text)
            if name == "stub":
                good = good and quoted(n) in " ".join(text.split())
            said = [line.strip() for line in text.splitlines() if "wrong:" in line or "passed" in line]
            done.append((good, f"lesson {n}, {name}: " + " | ".join(said[:3])))
        return done

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        found = [line for lines in pool.map(prove_lesson, jobs) for line in lines]
    for good, line in found:
        print("ok  " if good else "FAIL", line)
    print(f"{sum(bool(good) for good, _ in found)} of {len(found)}")
    return 0 if all(good for good, _ in found) else 1


if __name__ == "__main__":
    if len(sys.argv) in (5, 6) and sys.argv[1] == "engine":
        engine(int(sys.argv[2]), sys.argv[3], sys.argv[4], sys.argv[5:] == ["--mine"])
    elif sys.argv[1:] == ["stubs"]:
        write_stubs()
    elif len(sys.argv) >= 3 and sys.argv[1] == "prove":
        sys.exit(prove(*sys.argv[2:]))
    else:
        sys.exit(__doc__)
