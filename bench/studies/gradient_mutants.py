#!/usr/bin/env python3
"""Plants about a hundred errors in the sources of reverse steps and asks `supertac-check gradients` which op is wrong.

    bench/studies/gradient_mutants.py SOURCE SCRATCH RESULTS.csv

SOURCE, a git work tree, is copied to SCRATCH/tree. Every error of SITES is put in behind a switch (the environment
variable SUPERTAC_MUTANT), so that one build serves all. An error is found when rows of the check are wrong, and named
when the ops whose rows are wrong are those whose reverse step holds it.
"""

import collections
import csv
import json
import os
import pathlib
import shutil
import subprocess
import sys

SWITCH = """#pragma once
#include <cstdlib>
inline const int supertac_mutant = [] {
  const char* number = std::getenv("SUPERTAC_MUTANT");
  return number == nullptr ? 0 : std::atoi(number);
}();
#define MUTANT(number) (supertac_mutant == (number))
"""

CONVOLUTIONS = "conv1d conv2d conv_transpose1d conv_transpose2d"
BEFORE = "[i > 0 ? i - 1 : 0]"  # an index that is one too small

# Where a reverse step is: file; statement, with the expression that is spoiled between @; the ops whose gradient it is;
# then what stands for the expression without one of its terms, and at the wrong index ("" where that is no error).
SITES = [
    ("kernels/elementwise.cpp", "gx[i] += @y[i] > 0 ? gy[i] : slope * gy[i]@;",
     "relu leaky_relu", ("y[i] > 0 ? gy[i] : gy[i] * 0", "leaky_relu"), f"y[i] > 0 ? gy{BEFORE} : slope * gy[i]"),
    ("kernels/elementwise.cpp", "g[i] = @y[i] > 0 ? g[i] : slope * g[i]@;",
     f"{CONVOLUTIONS} linear", ("y[i] > 0 ? g[i] : g[i] * 0", CONVOLUTIONS), f"y{BEFORE} > 0 ? g[i] : slope * g[i]"),
    ("kernels/elementwise.cpp", "gx[i] += @gy[i] * y[i] * (1 - y[i])@;",
     "sigmoid", "gy[i] * y[i]", f"gy[i] * y[i] * (1 - y{BEFORE})"),
    ("kernels/elementwise.cpp", "gx[i] += @x[i] >= low && x[i] <= high ? gy[i] : 0@;",
     "clamp", "x[i] >= low ? gy[i] : 0", f"x{BEFORE} >= low && x[i] <= high ? gy[i] : 0"),
    ("kernels/elementwise.cpp", "g[i] += @gz[i] * (z[i] - mean[i]) / 2@;",
     "sample_gaussian", "gz[i] * z[i] / 2", f"gz[i] * (z[i] - mean{BEFORE}) / 2"),
    ("kernels/elementwise.cpp", "y[i] += @a[i] * b[i]@;", "multiply", "a[i]", f"a[i] * b{BEFORE}"),
    ("kernels/elementwise.cpp", "y[i] += @x@; });", "sum", "0 * x", ""),
    ("ops/arithmetic.cpp", "kernels::add_scaled(gx->size(), @factor@, b.gy().data(), gx->data());",
     "scale", "0 * factor", ""),
    ("kernels/channels.cpp", "gx[i] += @g[k] / static_cast<real>(pixels)@;",
     "global_mean", "g[k]", "g[k > 0 ? k - 1 : 0] / static_cast<real>(pixels)"),
    ("kernels/channels.cpp", "gx[i] += @gy[i] * gate[k]@;", "gated_sum", "gy[i]", "gy[i] * gate[k > 0 ? k - 1 : 0]"),
    ("kernels/channels.cpp", "gx[i] = @gy[i] * gate[k]@;", "gated_sum", "gy[i]", "gy[i] * gate[k > 0 ? k - 1 : 0]"),
    ("kernels/channels.cpp", "gs[k] += @gy[i] * x[i]@;",
     "gated_sum", "i % 5 == 0 ? 0 : gy[i] * x[i]", f"gy[i] * x{BEFORE}"),
    ("kernels/linear.cpp", "piece.data()[c] += @gy[row * cout + c]@;",
     f"{CONVOLUTIONS} linear", "row == first ? 0 : gy[row * cout + c]", "gy[row * cout + (c > 0 ? c - 1 : 0)]"),
    ("kernels/fast/conv.cpp", "to[o * cin + i] = @w[i * cout + o]@;",
     f"{CONVOLUTIONS} linear", "i == 0 ? 0 : w[i * cout + o]", "w[i * cout + (o > 0 ? o - 1 : 0)]"),
    ("kernels/fast/isa_kernels.inl", "@grad[j]@, acc[r][j]);",
     f"{CONVOLUTIONS} linear", "i == 0 ? Vec::broadcast(0) : grad[j]", ""),
    ("kernels/fast/narrow.cpp", "= @gy[pairs.outputs[i] * s.cout + o]@;",
     "conv2d", "t == 0 ? 0 : gy[pairs.outputs[i] * s.cout + o]", "gy[pairs.outputs[i > 0 ? i - 1 : 0] * s.cout + o]"),
    ("kernels/fast/narrow.cpp", "*gw++ += @inside.data()[i * kColumns + t * s.cout + o]@;",
     "conv2d", "t == 0 ? 0 : inside.data()[i * kColumns + t * s.cout + o]",
     "inside.data()[i * kColumns + (t + 1) * s.cout + o]"),
    ("kernels/fast/winograd.cpp", "*to++ = @w[i * cout + o]@;",
     "conv2d", "t == 4 ? 0 : w[i * cout + o]", "w[i * cout + (o > 0 ? o - 1 : 0)]"),
    ("kernels/losses.cpp", "g[i] += @factor * (a[i] - b[i])@;",
     "l2_loss", "factor * a[i]", f"factor * (a[i] - b{BEFORE})"),
    ("kernels/losses.cpp", "glog_var[i] += @g * (exp_same_bits(log_var[i]) - 1) / 2@;",
     "kl_divergence", "g * exp_same_bits(log_var[i]) / 2", f"g * (exp_same_bits(log_var{BEFORE}) - 1) / 2"),
    ("ops/vae.cpp", "kernels::add_scaled(n, @each@, b.value(0).data(), g->data());", "kl_divergence", "0 * each", ""),
    ("ops/vae.cpp", "kernels::add_scaled(n, @real(1)@, gz, g->data());", "sample_gaussian", "real(0)", ""),
    ("kernels/max_pool.h", "gx[from] += @gy[to]@;", "max_pool2d", "to == 3 ? 0 : gy[to]", "gy[to > 0 ? to - 1 : 0]"),
    ("kernels/ssim.cpp", "const real by_mean = @2 * (mb * n2 / (d1 * d2) - ma * s / d1)@;",
     "ssim", "2 * mb * n2 / (d1 * d2)", ""),
    ("kernels/ssim.cpp", "aa[i] = @each * (by_mean - 2 * mean_a[i] * by_var - mean_b[i] * by_cov)@;",
     "ssim", "each * (by_mean - 2 * mean_a[i] * by_var)",
     f"each * (by_mean - 2 * mean_a{BEFORE} * by_var - mean_b[i] * by_cov)"),
    ("kernels/ssim.cpp", "bb[i] = @each * 2 * by_var@;", "ssim", "each * by_var * 0", ""),
    ("kernels/ssim.cpp", "ab[i] = @each * by_cov@;", "ssim", "each * by_cov * 0", ""),
    ("kernels/ssim.cpp", "columns[y * wd_ + x + k] += @weight * from[y * ow_ + x]@;",
     "ssim", "k == 0 ? 0 : weight * from[y * ow_ + x]", "weight * from[y * ow_ + (x > 0 ? x - 1 : 0)]"),
    ("ops/losses.cpp", "kernels::add_scaled(gx->size(), @g@, gradient.data(), gx->data());",
     "softmax_cross_entropy", "0 * g", ""),
    ("kernels/shaping.h", "target[i] += @source[i]@;", "concat slice", "i == 0 ? 0 : source[i]", f"source{BEFORE}"),
]

Mutant = collections.namedtuple("Mutant", "number file line kind what ops marked new")


def spoiled(expression, kind, missing, index):
    """What stands for the expression, or "" where there is no such error."""
    if kind == "term":
        return missing
    if kind == "index":
        return index
    if expression == "grad[j]":  # a vector
        return "Vec::sub(Vec::broadcast(0), grad[j])" if kind == "sign" else "Vec::add(grad[j], grad[j])"
    return f"-({expression})" if kind == "sign" else f"2 * ({expression})"


def draw(tree):
    found = []
    for kind in ("sign", "factor", "term", "index"):
        for file, marked, ops, missing, index in SITES:
            missing, term_ops = missing if isinstance(missing, tuple) else (missing, ops)
            statement, expression = marked.replace("@real(1)@", "1").replace("@", ""), marked.split("@")[1]
            new = spoiled(expression, kind, missing, index)
            text = (tree / "autograd" / file).read_text()
            if text.count(statement) != 1:
                sys.exit(f"gradient_mutants: {file} holds {text.count(statement)} times, not once: {statement}")
            if new:
                found.append(Mutant(len(found) + 1, file, text[:text.index(statement)].count("\n") + 1, kind,
                                    f"{expression} -> {new}", set((term_ops if kind == "term" else ops).split()),
                                    marked, new))
    return found


def plant(tree, mutants):
    by_site = collections.defaultdict(list)
    for m in mutants:
        by_site[m.file, m.marked].append(m)
    for (file, marked), here in by_site.items():
        path = tree / "autograd" / file
        before, expression, after = marked.split("@")
        chosen = "".join(f"MUTANT({m.number}) ? ({m.new}) : " for m in here) + f"({expression})"
        statement = marked.replace("@real(1)@", "1").replace("@", "")
        path.write_text(path.read_text().replace(statement, f"{before}({chosen}){after}"))
    for file in {m.file for m in mutants}:
        path = tree / "autograd" / file
        if path.suffix != ".inl":
            path.write_text(f'#include "mutant.h"\n{path.read_text()}')
    for name in ("portable.cpp", "avx2.cpp", "avx512.cpp"):
        path = tree / "autograd/kernels/fast" / name
        path.write_text(f'#include "mutant.h"\n{path.read_text()}')


def main():
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    source, scratch, results = (pathlib.Path(a).resolve() for a in sys.argv[1:])
    tree, built = scratch / "tree", scratch / "build"
    shutil.rmtree(tree, ignore_errors=True)
    listed = subprocess.run(["git", "-C", source, "ls-files"], check=True, capture_output=True, text=True).stdout
    for name in filter(None, listed.split("\n")):
        if not name.startswith(("tests/", "docs/")) and (source / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source / name, tree / name)
    mutants = draw(tree)
    (tree / "mutant.h").write_text(SWITCH)
    plant(tree, mutants)
    flags = ["-DCMAKE_BUILD_TYPE=Release", "-DSUPERTAC_TESTS=OFF", f"-DCMAKE_CXX_FLAGS=-w -iquote {tree}"]
    if shutil.which("ccache"):
        flags.append("-DCMAKE_CXX_COMPILER_LAUNCHER=ccache")
    subprocess.run(["cmake", "-S", tree, "-B", built, "-G", "Ninja", *flags], check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["ninja", "-C", built, "-j", os.environ.get("JOBS", "1"), "supertac-check-gradients"], check=True,
                   stdout=subprocess.DEVNULL)
    with open(results, "w", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["mutant", "error", "file", "line", "change", "found", "named", "ops named", "worst entry"])
        for m in [None, *mutants]:
            run = subprocess.run([built / "bin/supertac-check-gradients", "--json", "-"],
                                 capture_output=True, text=True,
                                 env=dict(os.environ, SUPERTAC_MUTANT=str(m.number if m else 0)))
            rows = [row for row in json.loads(run.stdout)["rows"] if row["wrong"]]
            if m is None:
                if rows:
                    sys.exit("gradient_mutants: wrong without a mutant: " + ", ".join(row["name"] for row in rows))
                continue
            ops = [row["name"] for row in rows if row["kind"] == "op"]
            worst = max(rows, key=lambda row: row["worst"]["relative_error"])["worst"]["entry"] if rows else ""
            table.writerow([m.number, m.kind, "autograd/" + m.file, m.line, m.what, "yes" if rows else "no",
                            "yes" if set(ops) == m.ops else "no", " ".join(ops), worst])
            file.flush()
            print(m.number, m.kind, m.file, m.line, "ok" if set(ops) == m.ops else f"NO: {ops}, expected {m.ops}",
                  flush=True)


if __name__ == "__main__":
    main()
