"""Prints the results of supertac-classify as CSV: classification.py FILE.json ..."""
import json
import pathlib
import sys

print("split,view,part,windows,test_passes,runs,accuracy,passes_ci95_low,passes_ci95_high,lowest_run,highest_run,"
      "p_against_frame,plate,plate_accuracy")
for path in sys.argv[1:]:
    result = json.loads(pathlib.Path(path).read_text())
    for view, parts in result["views"].items():
        for part, r in parts.items():
            runs = r["accuracy_of_runs"]
            p = r.get("p_against_frame")
            common = [result["split"], view, part, r["windows"], r["passes"], result["runs"], f"{r['accuracy']:.4f}",
                      *(f"{x:.4f}" for x in r["ci95_passes"]), f"{min(runs):.4f}", f"{max(runs):.4f}",
                      "" if p is None else f"{p:.5f}"]
            for plate, row in r["confusion"].items():
                share = row[plate] / max(1, sum(row.values()))
                print(",".join(map(str, [*common, plate, f"{share:.4f}"])))
