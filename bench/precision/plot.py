"""Figure and table of docs/precision.md from the CSV of bench_precision.

usage: plot.py CSV FIGURE  (the table goes to standard output)"""

import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

LEVELS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
FLOOR = 1e-16  # of the axis


def read(path):
    with open(path, encoding="ascii") as file:
        # comments, and what Chipmunk says of itself, have no such number of commas
        rows = csv.DictReader(line for line in file if line.count(",") == 5)
        return [(r["scene"], r["contender"], float(r["error"]), float(r["cost"])) for r in rows]


def draw(rows, path):
    scenes = list(dict.fromkeys(r[0] for r in rows))
    names = list(dict.fromkeys(r[1] for r in rows))
    figure, axes = plt.subplots(3, (len(scenes) + 2) // 3, figsize=(13, 12), sharey=True)
    for axis, scene in zip(axes.flat, scenes):
        for name in names:
            points = [(cost, max(error, FLOOR)) for s, n, error, cost in rows
                      if (s, n) == (scene, name)]
            style = "-o" if name.startswith("carom") else "--s"
            axis.loglog(*zip(*points), style, markersize=3, label=name)
        axis.set_title(scene)
        axis.set_xlabel("processor seconds per simulated second")
        axis.set_ylabel("error at the end [m]")
        axis.grid(alpha=0.3)
    axes.flat[0].legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def table(rows):
    scenes = list(dict.fromkeys(r[0] for r in rows))
    names = list(dict.fromkeys(r[1] for r in rows))
    print("| scene | " + " | ".join(f"{level:.0e}" for level in LEVELS) + " |")
    print("|---" * (len(LEVELS) + 1) + "|")
    for scene in scenes:
        for kind in ("carom", "peers"):
            cells = []
            for level in LEVELS:
                reached = [(cost, name) for s, name, error, cost in rows
                           if s == scene and error <= level
                           and name.startswith("carom") == (kind == "carom")]
                cost, name = min(reached, default=(None, None))
                cells.append(f"{cost:.1e} {name.removeprefix('carom ')}" if reached else "-")
            if kind == "carom" or any(not n.startswith("carom") for n in names):
                print(f"| {scene}, {kind} | " + " | ".join(cells) + " |")


rows = read(sys.argv[1])
draw(rows, sys.argv[2])
table(rows)
