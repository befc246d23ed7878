#!/usr/bin/env python3
"""Breaks the product at 190 places, one at a time, and shows the test that notices.

    bench/studies/mutation.py SOURCE SCRATCH RESULTS.csv [FOLDER[=PROGRAM,...] ...]

SOURCE, a git work tree, is copied to SCRATCH/tree. Places that SEED draws from io, autograd, layers, models and data
are broken there, each behind a switch (the environment variable SUPERTAC_MUTANT), so that one build
serves all. Then every mutant runs the tests of its file, of its folder, and of the folders that use it, until one
fails, crashes or does not end. A mutant that does not compile is left out.

RESULTS.csv grows by a line a mutant and is continued when it exists; a line that is deleted is run again. The product
stays as it was first copied, tests are copied anew at every start. FOLDER: only mutants of these folders, asked of
these test programs instead of those in PROGRAMS. Its last column is for a reader, who says why a survivor lives.
"""

import collections
import csv
import os
import pathlib
import random
import re
import resource
import shutil
import subprocess
import sys
import time

SEED = 13
PLACES = {"io": 25, "autograd": 50, "layers": 15, "models": 35, "data": 65}  # drawn from each folder

# Test programs in the order in which they are asked.
PROGRAMS = {
    "io": ["io_test", "layers_test", "data_test"],
    "autograd": ["autograd_test", "autograd_f64_test", "layers_test", "parity_test", "models_test"],
    "layers": ["layers_test", "layers_f64_test", "parity_test"],
    "models": ["models_test", "models_f64_test", "failures_test"],
    "data": ["data_test", "models_test", "failures_test"],
}

HEADERS = ("exp.h", "hash.h", "median.h", "same_bits.h", "sums.h")  # with functions worth breaking

COLUMNS = ["mutant", "file", "line", "change", "tests run", "verdict", "killing test", "why it lives", "command", "commit"]
SWITCH = """#pragma once
#include <cstdlib>
inline const int supertac_mutant = [] {
  const char* number = std::getenv("SUPERTAC_MUTANT");
  return number == nullptr ? 0 : std::atoi(number);
}();
#define MUTANT(number) (supertac_mutant == (number))
"""
COMMAND = "bench/studies/mutation.py SOURCE SCRATCH RESULTS.csv"
MEMORY = 12 << 30  # bytes; a mutant that asks for more ends with bad_alloc

Mutant = collections.namedtuple("Mutant", "name file line old new what")


# ---- places and changes --------------------------------------------------------------------------------------------

SWAPS = [(f" {a} ", f" {b} ") for a, b in ["+-", "-+", "*/", "/*", ("<", "<="), ("<=", "<"), (">", ">="), (">=", ">"),
                                           ("==", "!="), ("!=", "=="), ("&&", "||"), ("||", "&&")]]
SWAPS += [("std::min", "std::max"), ("std::max", "std::min"), ("true", "false"), ("false", "true")]
NUMBER = re.compile(r"(?<![\w.])(\d+\.\d*(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+|\d+)(?=[FfuUlL]*(?![\w.]))")
ARGUMENTS = re.compile(r"(?<=\()([a-z]\w*), ([a-z]\w*)(?=\))")
SKIP = re.compile(r"^\s*(//|#|case |default:|template|using |static_assert|namespace |struct |class |enum |[*\":,?])"
                  r"|constexpr|R\"|\[\[")
EXPRESSION = re.compile(r"^(\s+(?:return|(?:(?:const|static) )*[\w:<>,*& ]*?[\w\].>)-]+ (?:[-+*/|&]?=)) )"
                        r"([^{}\[]*(?:\[\w+\][^{}\[]*)*);$")
STATEMENT = re.compile(r"^(\s+)((?!return|throw|delete|break|continue|const |auto |static |else|if |for |while |do "
                       r"|std::\w+[<\w:> ]* \w+\()"
                       r"(?:[\w:.\[\]>*()-]+\(.*\)|[\w.\[\]*>()-]+ [-+*/|&]?= .*|\+\+[\w.\[\]]+));$")
SHORT_LOOP = "the loop ends one early"
LOOP = re.compile(r"^(\s*for \([\w:]+ (\w+) = [^;]+; )(\2 < )")
CONSTANT = re.compile(r"^(\s*)constexpr ((?:double|float|int|real|Dim|std::size_t|std::int64_t) \w+ = )"
                      r"([\d.]+(?:e-?\d+)?)(F?;.*)$")
CONDITION = re.compile(r"^(\s*(?:\} else )?if )\(")


def masked(text):
    """The text with the letters of strings blotted out, so that nothing is found in them."""
    return re.sub(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'', lambda m: "~" * len(m.group()), text)


def other_number(text):
    if re.fullmatch(r"\d+", text):
        return str(int(text) + 1)
    return repr(float(text) * 1.25) if float(text) else "0.25"


def variants(expression):
    """Every change of one operator, number or pair of arguments."""
    blind = masked(expression)
    for old, new in SWAPS[1 if "~" in blind or "to_string" in blind else 0:]:  # texts are only ever added
        for at in (m.start() for m in re.finditer(re.escape(old), blind)):
            if not old[0].isalpha() or not re.match(r"\w", blind[at + len(old):] or " "):
                yield expression[:at] + new + expression[at + len(old):]
    for m in NUMBER.finditer(blind):
        yield expression[:m.start()] + other_number(m.group()) + expression[m.end():]
    for m in ARGUMENTS.finditer(blind):
        if m.group(1) != m.group(2):
            yield expression[:m.start()] + f"{m.group(2)}, {m.group(1)}" + expression[m.end():]


def balanced(text, start):
    """Where the bracket at `start` closes, or -1 when not in this text."""
    depth = 0
    for at in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[at], 0)
        if depth == 0:
            return at
    return -1


def has_comma(text):
    """Whether a comma stands outside all brackets: two expressions, or two variables."""
    blind, depth = masked(text), 0
    for letter in blind:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            return True
    return False


def changes(lines, index):
    """(new line with MUTANT, what changed) for every change of one line that is a whole statement or condition."""
    line, before = lines[index], next((t for t in map(str.strip, reversed(lines[:index])) if t), "")
    blind = masked(line)
    if constant := CONSTANT.match(line):
        space, name, number, rest = constant.groups()
        other = other_number(number)
        yield f"{space}const {name}MUTANT ? {other} : {number}{rest}", f"{number} -> {other}"
        return
    if SKIP.search(blind) or " // " in blind:
        return
    if condition := CONDITION.match(line):
        start, end = condition.end() - 1, balanced(blind, condition.end() - 1)
        inner = line[start + 1:end]
        if end < 0 or ";" in masked(inner) or re.search(r"[^=!<>]=[^=]", masked(inner)):
            return
        for new, what in [(f"!MUTANT && ({inner})", "never"), (f"MUTANT || ({inner})", "always")]:
            yield f"{line[:start]}({new}){line[end + 1:]}", f"condition: {what}"
        for other in variants(inner):
            yield f"{line[:start]}(MUTANT ? ({other}) : ({inner})){line[end + 1:]}", f"{inner} -> {other}"
        return
    if loop := LOOP.match(line):
        yield line[:loop.start(3)] + f"{loop.group(2)} + MUTANT < " + line[loop.end(3):], SHORT_LOOP
    if not re.search(r"[;{}]$|^$", before) or before.startswith(("enum", "else", "for")):
        return
    statement = STATEMENT.match(line)
    if statement and not before.endswith("else"):
        yield f"{statement.group(1)}if (!MUTANT) {statement.group(2)};", "left out"
    if expression := EXPRESSION.match(line):
        head, value = expression.groups()
        for other in variants(value) if not has_comma(value) else []:
            yield f"{head}MUTANT ? ({other}) : ({value});", f"{value} -> {other}"


def draw(tree, folder):
    """The mutants of a folder, at most one a line."""
    rng, places, found = random.Random(f"{SEED} {folder}"), {}, []
    for path in sorted((tree / folder).rglob("*")):
        if path.suffix in (".cpp", ".inl") or path.name in HEADERS:
            file, lines = str(path.relative_to(tree)), path.read_text().split("\n")
            for i, line in enumerate(lines):
                if possible := list(changes(lines, i)):
                    places[file, i + 1, line] = possible
    for place in sorted(places):  # every second of the loops: there are so many
        if len(places[place]) == 1 and places[place][0][1] == SHORT_LOOP and rng.random() < 0.5:
            del places[place]
    for file, at, line in sorted(rng.sample(sorted(places), min(PLACES[folder], len(places)))):
        found.append((file, at, line, *rng.choice(places[file, at, line])))
    return [Mutant(f"{folder}-{i}", *mutant) for i, mutant in enumerate(found, 1)]


def plant(pristine, tree, touched, mutants, numbers):
    """Writes every file that holds mutants, or held some that do not compile."""
    for file in touched:
        lines = (pristine / file).read_text().split("\n")
        for m in (m for m in mutants if m.file == file):
            new, last = m.new.replace("MUTANT", f"MUTANT({numbers[m.name]})"), m.line - 1 + m.old.count("\n")
            old = "\n".join(lines[m.line - 1:last + 1])
            block = old.replace(m.old, new, 1).split("\n")
            # the number of lines stays as it was, so that the compiler's messages point at the mutant
            lines[m.line - 1:last + 1] = [" ".join(block)] + [""] * (last - m.line + 1)
        text = '#include "mutant.h"\n' + "\n".join(lines)
        if (tree / file).read_text() != text:
            (tree / file).write_text(text)


# ---- building and running ------------------------------------------------------------------------------------------

def copy(source, tree):
    listed = subprocess.run(["git", "-C", source, "ls-files"], check=True, capture_output=True, text=True)
    fresh = not tree.exists()
    for name in filter(None, listed.stdout.split("\n")):
        if (fresh or name.startswith("tests/")) and (source / name).is_file():
            target = tree / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if not target.exists() or target.read_bytes() != (source / name).read_bytes():
                shutil.copy(source / name, target)
    for path in (tree / "tests").rglob("*"):
        if path.is_file() and not (source / path.relative_to(tree)).exists():
            path.unlink()
    if fresh:
        (tree / "mutant.h").write_text(SWITCH)
        head = subprocess.run(["git", "-C", source, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
        (tree.parent / "commit").write_text(head.stdout.strip())


def build(pristine, tree, folder, programs, mutants, numbers):
    """Builds, leaving out mutants that do not compile; returns those that do."""
    touched = {m.file for m in mutants}
    flags = [f"-DCMAKE_CXX_FLAGS=-w -iquote {tree}", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_CXX_FLAGS_RELEASE=-O1"]
    if shutil.which("ccache"):
        flags.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    subprocess.run(["cmake", "-S", tree, "-B", folder, "-G", "Ninja", "-DSUPERTAC_APPS=OFF", *flags], check=True,
                   stdout=subprocess.DEVNULL)
    while True:
        plant(pristine, tree, touched, mutants, numbers)
        run = subprocess.run(["ninja", "-C", folder, "-k", "0", "-j", os.environ.get("JOBS", "1"), *programs],
                             capture_output=True, text=True)
        if run.returncode == 0:
            return mutants
        found = re.findall(r"^(\S+?):(\d+):\d+: (?:error|note: in expansion of macro"
                           r"|note: .* was not initialized with a constant)", run.stdout, re.M)
        found += re.findall(r"inlined from .* at (\S+?):(\d+):\d+[,:]$", run.stdout, re.M)  # an intrinsic's constant
        wrong = {(os.path.relpath(os.path.join(folder, file), tree), int(line) - 1) for file, line in found}
        bad = [m for m in mutants if any((m.file, m.line + i) in wrong for i in range(m.old.count("\n") + 1))]
        if not bad:  # a constant that an array's size or a template needs, further down
            names = set(re.findall(r"^ *\d+ \|.*?\b(k[A-Z]\w*)", run.stdout, re.M))
            names |= set(re.findall(r"\[(k[A-Z]\w*)\]", run.stdout))
            bad = [m for m in mutants if (c := CONSTANT.match(m.old)) and c.group(2).split()[1] in names]
        for m in bad:
            print(f"does not compile: {m.name} {m.file}:{m.line} {m.what}", flush=True)
        if not bad:
            sys.exit(f"mutation: the copy does not build:\n{run.stdout[-4000:]}")
        mutants = [m for m in mutants if m not in bad]


def run_tests(program, number, tests, limit):
    """(how many tests ran, what failed first or '')"""
    try:
        run = subprocess.run([program, f"--gtest_filter={tests}", "--gtest_fail_fast", "--gtest_brief=0"],
                             env=dict(os.environ, SUPERTAC_MUTANT=str(number)), capture_output=True, text=True,
                             errors="replace", timeout=limit, cwd=program.parent,
                             preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)))
        out, end = run.stdout, f"ended with {run.returncode}" if run.returncode else ""
    except subprocess.TimeoutExpired as late:
        out, end = (late.stdout or b"").decode(errors="replace"), f"did not end in {limit:.0f} s"
    started = re.findall(r"^\[ RUN      \] (\S+)", out, re.M)
    failed = re.findall(r"^\[  FAILED  \] (\S+?),? .*\(\d+ ms\)", out, re.M)
    if not end:
        return len(started), ""
    return len(started), failed[0] if failed else f"{started[-1] if started else program.name} ({end})"


def suites_of(tree, file):
    """The filter for the tests that mirror a source, or ''."""
    folder, stem = os.path.split(os.path.splitext(file)[0])
    names = set()
    for test in (tree / "tests" / folder).glob(f"{stem}*_test.cpp"):
        names |= set(re.findall(r"^TEST(?:_F|_P)?\((\w+),", test.read_text(), re.M))
    return ":".join(f"{name}.*:*/{name}.*" for name in sorted(names))


def judge(mutant, number, programs, tree, where, limits):
    ran, mirror = 0, suites_of(tree, mutant.file)
    steps = [(programs[0], mirror)] if mirror else []
    for program, tests in steps + [(p, "*") for p in programs]:
        seconds, left_out = limits[program]
        count, killer = run_tests(where[program], number, tests + left_out, seconds)
        ran += count
        if killer:
            return ran, "killed", killer
    return ran, "survived", ""


def baseline(where):
    """For each program a time limit, and a filter against tests that fail without any mutant."""
    limits = {}
    for name, program in where.items():
        begin = time.monotonic()
        run = subprocess.run([program], capture_output=True, text=True, errors="replace", cwd=program.parent)
        failed = re.findall(r"^\[  FAILED  \] (\S+?),? .*\(\d+ ms\)", run.stdout, re.M)
        if run.returncode and not failed:
            sys.exit(f"mutation: {name} does not pass without a mutant:\n{run.stdout[-2000:]}{run.stderr[-2000:]}")
        seconds = time.monotonic() - begin
        limits[name] = 60 + 4 * seconds, "-" + ":".join(failed) if failed else ""
        print(f"{name}: {seconds:.0f} s; left out: {', '.join(failed) or 'nothing'}", flush=True)
    return limits


def main():
    if len(sys.argv) < 4:
        sys.exit(__doc__)
    source, scratch, results = (pathlib.Path(a).resolve() for a in sys.argv[1:4])
    asked = dict((f"{a}=".split("=")[:2] for a in sys.argv[4:] or PLACES))
    asked = {folder: tests.split(",") if tests else PROGRAMS[folder] for folder, tests in asked.items()}
    tree, built = scratch / "tree", scratch / "build"
    pristine = scratch / "pristine"  # what mutants are drawn from
    copy(source, pristine)
    copy(source, tree)
    commit = (scratch / "commit").read_text()
    mutants = [m for folder in PLACES for m in draw(pristine, folder)]
    numbers = {m.name: i for i, m in enumerate(mutants, 1)}
    programs = list(dict.fromkeys(p for tests in asked.values() for p in tests))
    mutants = build(pristine, tree, built, programs, mutants, numbers)
    where = {p: next(built.glob(f"tests/*/{p}")) for p in programs}
    done = set()
    if results.exists():
        with open(results, newline="") as file:
            done = {row["mutant"] for row in csv.DictReader(file)}
    else:
        with open(results, "w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(COLUMNS)
    limits = baseline(where)
    for m in mutants:
        folder = m.name.split("-")[0]
        if m.name in done or folder not in asked:
            continue
        ran, verdict, killer = judge(m, numbers[m.name], asked[folder], tree, where, limits)
        with open(results, "a", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(
                [m.name, m.file, m.line, m.what, ran, verdict, killer, "", COMMAND, commit])
        print(f"{m.name} {m.file}:{m.line} {m.what} | {killer or verdict.upper()}", flush=True)


if __name__ == "__main__":
    main()
