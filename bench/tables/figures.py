"""CSV files of bench/results, means with intervals, tables of Markdown: what the tables are written with."""
import csv
import math
import pathlib

RESULTS = pathlib.Path(__file__).resolve().parents[1] / "results"
T_975 = {1: 12.706, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262}  # Student's t


def rows(name):
    with open(RESULTS / name, newline="") as file:
        found = list(csv.DictReader(line for line in file if not line.startswith("#")))
    for number, row in enumerate(found, 2):  # a stray comma would move all columns behind it
        if None in row or None in row.values():
            raise SystemExit(f"{name}: line {number} has not as many values as the head; quote commas within a value")
    return found


def table(head, lines):
    return "\n".join("| " + " | ".join(line) + " |" for line in [head, ["---"] * len(head), *lines])


def mean(values):
    return sum(values) / len(values)


def interval(values):
    """Half the 95 % interval of the mean."""
    m = mean(values)
    return T_975.get(len(values) - 1, 1.96) * math.sqrt(sum((v - m) ** 2 for v in values) / (len(values) - 1) / len(values))


def plus_minus(value, half, digits):
    return f"{float(value):.{digits}f}" + (f" ± {float(half):.{digits}f}" if float(half or 0) > 0 else "")


def over_seeds(chosen, column, digits):
    """Mean and interval; the values themselves where they are fewer than three."""
    values = [float(r[column]) for r in chosen if r[column]]
    if len(values) < 3:
        return ", ".join(f"{v:.{digits}f}" for v in values)
    return plus_minus(mean(values), interval(values), digits)


def line_through(x, y):
    mx, my = mean(x), mean(y)
    sxx, syy = sum((a - mx) ** 2 for a in x), sum((b - my) ** 2 for b in y)
    sxy = sum((a - mx) * (b - my) for a, b in zip(x, y))
    return my - sxy / sxx * mx, sxy / sxx, sxy / math.sqrt(sxx * syy)
