#!/usr/bin/env python3
"""Where the seconds of a whole job go: from text recordings to a scored network of preset `paper`, and the demo.

    bench/studies/whole_job.py CLONE TEXT_DIR [--epochs 5] [--out bench/results/speed/whole_job.csv]

CLONE is a fresh clone of the project: its scripts/demo.sh builds there, and the programs that it built do the other job.
A phase ends with the line that its program prints then. Testing after each epoch is the time from the end of an epoch to
the next line of the log, less the median time of as many steps within an epoch.
"""
import argparse
import csv
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from source import ROOT, source  # noqa: E402

STEPS_PER_LINE = 50


def stamped(command, **options):
    """The lines that a command prints, each with the seconds since its start; the last one is its end."""
    start = time.monotonic()
    process = subprocess.Popen(list(map(str, command)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    lines = [(time.monotonic() - start, line.rstrip()) for line in process.stdout]
    if process.wait() != 0:
        sys.exit(f"whole_job.py: {command[0]} failed: {lines[-1][1] if lines else 'no line'}")
    return [*lines, (time.monotonic() - start, "")]


def last(lines, pattern):
    """When the last line of this pattern came."""
    return max(at for at, line in lines if re.match(pattern, line))


def testing(log):
    """Seconds of testing after each epoch but the last, from the log of a training."""
    lines = list(csv.DictReader(log.open()))
    seconds = [float(r["time_s"]) for r in lines]
    steps = [int(r["step"]) for r in lines]
    ends = [bool(r["test_ssim"]) for r in lines]
    gaps = [(b - a, t - s, end) for a, b, s, t, end in zip(seconds, seconds[1:], steps, steps[1:], ends)]
    a_step = statistics.median(took / count for took, count, end in gaps if not end and count == STEPS_PER_LINE)
    return sum(took - count * a_step for took, count, end in gaps if end) * sum(ends) / max(1, sum(ends) - 1)


def training(lines, log):
    begin, end = last(lines, "training on "), last(lines, r".* parameters after ")
    tested = testing(log)
    return {"reading recordings, cutting windows": begin, "training": end - begin - tested,
            "testing after each epoch": tested}


def paper(programs, text, epochs):
    with tempfile.TemporaryDirectory() as folder:
        recordings, model = f"{folder}/recordings", pathlib.Path(folder) / "model.safetensors"
        phases = {"importing text": stamped([programs / "supertac-import", text, "--out", recordings])[-1][0]}
        lines = stamped([programs / "supertac-train", "--data", recordings, "--out", model, "--preset", "paper", "--epochs", epochs])
        phases |= training(lines, model.with_suffix(".run") / "log.csv")
        phases["scoring"] = stamped([programs / "supertac-evaluate", "--model", model, "--data", recordings])[-1][0]
    return phases


def demo(clone):
    lines = stamped(["scripts/demo.sh"], cwd=clone)
    built, simulated = last(lines, r"\[\d+/\d+\]"), last(lines, "training on trial 1 ")
    begin = next(i for i, (at, _) in enumerate(lines) if at == simulated)
    phases = training([(at - simulated, line) for at, line in lines[begin:]], clone / "out/demo/model.run/log.csv")
    return {"building": built, "simulating": simulated - built, **phases, "scoring": lines[-1][0] - last(lines, r".* parameters after ")}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clone", type=pathlib.Path)
    parser.add_argument("text")
    parser.add_argument("--epochs", type=int, default=5)
    parser.add_argument("--out", default=ROOT / "bench/results/speed/whole_job.csv")
    options = parser.parse_args()
    came_from = source()
    jobs = {"demo": demo(options.clone)}
    subprocess.run(["cmake", "--build", "build", "--target", "supertac-import"], cwd=options.clone, check=True, capture_output=True)
    jobs["paper"] = paper(options.clone / "build/bin", options.text, options.epochs)
    with open(options.out, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["job", "phase", "seconds", *came_from])
        for job, phases in jobs.items():
            for phase, seconds in phases.items():
                writer.writerow([job, phase, f"{seconds:.1f}", *came_from.values()])
                print(f"{job:6} {phase:36} {seconds:7.1f} s {100 * seconds / sum(phases.values()):4.0f} %")


if __name__ == "__main__":
    main()
