"""The rig, the live page, attacks, promises, and tests that notice."""
import itertools

from .figures import mean, rows, table


def rig():
    pulls, kills = rows("rig/unplug.csv"), rows("rig/kill.csv")
    soak = {r["quantity"]: float(r["measured"]) for r in rows("rig/soak.csv")}
    ends, calls = rows("rig/ends.csv"), rows("rig/io.csv")

    def latest(port, when):
        return max(float(r["noticed_ms"]) for r in pulls if (r["port"], r["when"]) == (port, when))

    lost = sorted(float(r["lost_s"]) for r in kills)
    lines = [
        ["`rig/unplug.csv`", f"{len(pulls)} cables pulled; the latest was noticed after {latest('board', 'idle'):.1f} ms (board idle), "
         f"{latest('printer', 'idle'):.1f} ms (printer idle), {latest('board', 'collection'):.1f} and "
         f"{latest('printer', 'collection'):.1f} ms (in a collection)"],
        ["`rig/kill.csv`", f"{len(kills)} kills of a running collection lost {lost[len(lost) // 2]:.2f} s (median) and at most {lost[-1]:.3f} s; "
         f"{sum(bool(r['broken']) for r in kills)} broke a promise"],
        ["`rig/ends.csv`", f"{len(ends)} ends by signal or full disk; {sum(bool(r['broken']) for r in ends)} left the finger down, "
         "a wrong exit code or more than one line"],
        ["`rig/io.csv`", f"{len(calls)} collections with one failing call or short writes; {sum(bool(r['broken']) for r in calls)} ended "
         "otherwise than promised"],
        ["`rig/soak.csv`", f"{soak['seconds']:.0f} s of a board with seeded faults: {soak['frames lost']:.0f} frames lost, "
         f"{soak['losses counted']:.0f} counted; {soak['latency median ms']:.2f} ms from frame to picture, {soak['latency p99 ms']:.2f} ms at "
         f"the 99th percentile; {soak['memory kB'] / 1000:.1f} MB, drift {soak['memory drift kB']:.0f} kB"],
    ]
    return table(["file", "result"], lines)


def page():
    runs, hour = rows("page_load.csv"), rows("page_hour.csv")
    of = lambda load, column: [float(r[column]) for r in runs if r["load"] == load]
    p99 = {(r["pair"], r["load"]): float(r["p99_ms"]) for r in runs}
    ratios = sorted(p99[pair, "with"] / p99[pair, "without"] for pair, load in p99 if load == "with")
    middle = (ratios[(len(ratios) - 1) // 2] + ratios[len(ratios) // 2]) / 2
    lines = [["`page_load.csv`", f"{len(ratios)} pairs: 99th percentile from frame to picture with the load {middle:.2f} times that without "
              f"(median; {ratios[0]:.2f} to {ratios[-1]:.2f}), while the host gave {mean(of('with', 'stolen_percent')):.0f} % of the time to "
              f"others with and {mean(of('without', 'stolen_percent')):.0f} % without; frames lost in the port "
              f"{sum(of('with', 'lost')):.0f} of {sum(of('with', 'frames')):.0f} with, "
              f"{sum(of('without', 'lost')):.0f} of {sum(of('without', 'frames')):.0f} without; "
              f"{mean(of('with', 'events_a_page_a_second')):.1f} pictures a second for each page that reads"]]
    span = lambda column: f"{min(float(r[column]) for r in hour):.0f} to {max(float(r[column]) for r in hour):.0f}"
    lines.append(["`page_hour.csv`", f"{float(hour[-1]['seconds']):.0f} s: heap of the page {span('page_heap_kb')} kB, {span('bytes_a_second')} bytes a "
                  f"second; the program's memory grew by {float(hour[-1]['program_resident_kb']) - float(hour[0]['program_resident_kb']):.0f} kB"])
    return table(["file", "result"], lines)


def hostile():
    counted = ["slow mutants", "crashes", "hangs", "above 1 GB", "raw exceptions", "control codes", "shells", "files overwritten", "half folders"]
    lines = []
    for campaign in dict.fromkeys(r["campaign"] for r in rows("hostile.csv")):
        found = {r["what"]: r["count"] for r in rows("hostile.csv") if r["campaign"] == campaign}
        tried = next(what for what in ("command lines", "mutants", "signals") if what in found)
        lines.append([campaign, f"{int(found[tried]):,}"] +
                     [found[c] for c in counted])
    return table(["what was tried", "how many"] + counted, lines)


def promises():
    return table(["promise", "how it is tested", "figure"], [[r["promise"], r["tests"], r["figure"]] for r in rows("promises.csv")])


def mutation():
    lines = []
    for folder, group in itertools.groupby(rows("audit/mutation.csv"), lambda r: r["file"].split("/")[0]):
        mutants = list(group)
        lives = [f"`{r['file']}:{r['line']}`: {r['why it lives']}" for r in mutants if r["verdict"] == "survived"]
        lines.append([folder, str(len(mutants)), str(len(mutants) - len(lives)), "; ".join(lives) or "none"])
    return table(["folder", "mutants", "noticed", "not noticed, and why"], lines)


TABLES = [rig, page, hostile, promises, mutation]
