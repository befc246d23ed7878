"""Times beside other engines, int8, streaming, and how time grows."""
from .figures import line_through, mean, rows, table

TASKS = {"infer 1": "inference, batch 1", "infer 8": "inference, batch 8", "infer 64": "inference, batch 64",
         "int8 1": "in int8, batch 1", "int8 8": "in int8, batch 8", "int8 64": "in int8, batch 64",
         "train 1": "training step of 64 windows", "train 2": "the same on two threads"}


def duration(us):
    us = float(us)
    return f"{us / 1000:.2f} ms" if us >= 1000 else f"{us:.0f} us"


PACKAGES = {"pytorch": "torch", "torch.compile": "torch", "onnx": "onnxruntime", "openvino": "openvino"}


def with_version(peer, versions):
    """A peer's name, followed by the version of its package as compare.py found it."""
    known = dict(zip(versions.split()[::2], versions.split()[1::2]))
    return f"{peer} {known[package].split('+')[0]}" if (package := PACKAGES.get(peer.split()[0])) in known else peer


def speed(file="peers.csv"):
    return table(["", "SuperTac", "compared with", "", "times as fast (95 % interval)", "share of FMA peak"],
                 [[TASKS[r["task"]], duration(r["ours_us"]), with_version(r["peer"], r["versions"]), duration(r["peer_us"]),
                   f"{float(r['ratio']):.1f} ({float(r['ratio_low']):.1f} to {float(r['ratio_high']):.1f})",
                   f"{100 * float(r['ours_share']):.0f} %"] for r in rows(file)])


def speed_avx512():
    return speed("peers_avx512.csv")


def speed_avx2():
    return speed("peers_avx2.csv")


def precision():
    lines = []
    found = rows("precision.csv")
    for preset in dict.fromkeys(r["name"].split()[0] for r in found if r["precision"] == "int8"):
        of = {kind: [r for r in found if r["name"].split()[0] == preset and r["precision"] == kind] for kind in ("fp32", "int8")}
        lost = [float(a["contact_ssim"]) - float(b["contact_ssim"]) for a, b in zip(of["fp32"], of["int8"])]
        middle = lambda kind, column, digits: f"{mean([float(r[column]) for r in of[kind]]):.{digits}f}"
        lines.append([preset, *(middle(kind, column, digits) for column, digits in (("contact_ssim", 4), ("contact_psnr_db", 2))
                                for kind in of), f"{max(lost):.4f}", *(middle(kind, "median_us", 0) + " us" for kind in of)])
    return table(["model", "contact SSIM in fp32", "in int8", "PSNR dB in fp32", "in int8", "most that a seed loses",
                  "time of a picture in fp32", "in int8"], lines)


def streaming():
    f = {r["figure"]: float(r["value"]) for r in rows("streaming.csv")}
    return table(["a window every millisecond, us", "median", "99.9 %"],
                 [["processor time", f"{f['cpu_median_us']:.0f}", f"{f['cpu_p99.9_us']:.0f}"],
                  ["time on the wall", f"{f['wall_median_us']:.0f}", f"{f['wall_p99.9_us']:.0f}"]]) + (
        f"\n\nThe process ran for {f['windows'] / 1000:.0f} s, held {f['peak_resident_mb']:.0f} MB, and drew its first picture "
        f"{f['ready_ms']:.0f} ms after its start.")


def growth():
    lines = []
    for axis, column, unit, name in (("timesteps", "value", "sample of the window", "length of the window, 32 to 512"),
                                     ("batch", "value", "window", "batch, 1 to 256"),
                                     ("channels", "mmac", "million multiply-adds", "channels, 8 to 96"),
                                     ("training_windows", "value", "window of the data set", "training, 512 to 4096 windows")):
        chosen = [r for r in rows("linear_cost.csv") if r["axis"] == axis]
        start, slope, r = line_through([float(c[column]) for c in chosen], [float(c["us"]) for c in chosen])
        lines.append([name, f"{start:.0f} us", f"{slope:.3g} us a {unit}", f"{r:.3f}"])
    return table(["what grows", "fixed cost", "cost of one more", "r"], lines)


TABLES = [speed, speed_avx512, speed_avx2, precision, streaming, growth]
