"""Page of the cost by phase from the CSV of count.py.

usage: plot.py CSV OUTDIR  (writes phases.svg and .png, phases.md)"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

plt.rcParams["svg.fonttype"] = "none"

HEAD = """# Cost by phase

Where the instructions of a step of 1/60 s of `located` go, counted by callgrind in the Release build of `bench_step` (all steps, also the first ones): a function's own
instructions count for the phase of its source file (`bench/phases/count.py`). *outside*: libm and libc. The tape is filled by recorded steps only, and takes nothing here;
what recording costs is in [gradient.csv](gradient.csv).

![Share of instructions by phase](phases.svg)

"""


def main(path, out):
    with open(path, encoding="ascii", errors="replace") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        print("plot.py: no phases were counted", file=sys.stderr)
        return
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    phases = list(dict.fromkeys(r["phase"] for r in rows))
    share = {(r["scene"], r["phase"]): float(r["share"]) for r in rows}
    count = {s: sum(float(r["instructions"]) for r in rows if r["scene"] == s) for s in scenes}
    figure, axis = plt.subplots(figsize=(9, 0.5 * len(scenes) + 1.2))
    left = [0.0] * len(scenes)
    for phase in phases:
        widths = [share[s, phase] for s in scenes]
        axis.barh(scenes, widths, left=left, label=phase)
        left = [a + b for a, b in zip(left, widths)]
    axis.invert_yaxis()
    axis.set_xlabel("share of instructions", fontsize=8)
    axis.legend(fontsize=6, ncol=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    figure.tight_layout()
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(out, f"phases.{kind}"), dpi=80)
    lines = ["| scene | instructions per step | " + " | ".join(phases) + " |", "|---" * (len(phases) + 2) + "|"]
    for s in scenes:
        lines.append(f"| {s} | {count[s]:.3g} | " + " | ".join(f"{100 * share[s, p]:.0f} %" for p in phases) + " |")
    with open(os.path.join(out, "phases.md"), "w", encoding="ascii") as file:
        file.write(HEAD + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
