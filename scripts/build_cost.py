#!/usr/bin/env python3
"""What a clean build costs: processor seconds, the largest compiler's memory, the size of what is installed.

Builds in a folder of its own, without a compiler's cache: once what scripts/demo.sh builds, once everything with tests.
Prints a table, of which CONTRIBUTING.md has a row; times are of this machine's processors and grow where others use them as well.
    scripts/build_cost.py [demo|all]
"""
import pathlib
import resource
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
QUICK = ["-DSUPERTAC_QUICK_BUILD=ON"]
BUILDS = {"demo": ("what the demo needs", [*QUICK, "-DSUPERTAC_TESTS=OFF"],
                   ["--target", "supertac-simulate", "supertac-train", "supertac-evaluate"]),
          "all": ("everything, with tests", [*QUICK, "-DSUPERTAC_TESTS=ON"], [])}
# Runs a compiler and notes the most memory that it held, in kB.
LAUNCHER = """#!/usr/bin/env python3
import resource, subprocess, sys
code = subprocess.run(sys.argv[1:]).returncode
with open({log!r}, "a") as log:
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, sys.argv[-1], file=log)
sys.exit(code)
"""


def seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cost(options, targets):
    with tempfile.TemporaryDirectory() as folder:
        build, log, launcher = f"{folder}/build", f"{folder}/log", pathlib.Path(folder) / "launcher"
        launcher.write_text(LAUNCHER.format(log=log))
        launcher.chmod(0o755)
        run = lambda *words: subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        run("cmake", "-S", ".", "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
            *options)
        begin = seconds()
        run("cmake", "--build", build, *targets)
        took, size = seconds() - begin, ""
        if not targets:
            run("cmake", "--install", build, "--prefix", f"{folder}/installed", "--strip")
            files = [path for path in pathlib.Path(f"{folder}/installed").rglob("*") if path.is_file() and not path.is_symlink()]
            size = f"{sum(path.stat().st_size for path in files) / 1e6:.1f}"
        memory, source = max((int(line.split(" ", 1)[0]), line.split(" ", 1)[1]) for line in open(log))
        return f"{took:.0f}", f"{memory * 1024 / 1e6:.0f} ({pathlib.Path(source.strip()).name})", size


def main():
    if any(word not in BUILDS for word in sys.argv[1:]):
        sys.exit(__doc__)
    print("| a clean build of | processor seconds | largest compiler, MB | installed, MB |\n| --- | --- | --- | --- |")
    for name in sys.argv[1:] or BUILDS:
        about, options, targets = BUILDS[name]
        print("| " + " | ".join([about, *cost(options, targets)]) + " |", flush=True)


if __name__ == "__main__":
    main()
