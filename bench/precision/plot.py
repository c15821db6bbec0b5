"""Figures and page of error against run time from the CSV of bench_precision.

usage: plot.py CSV OUTDIR  (writes precision.svg and .png, profile.svg and .png, precision.md)"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

plt.rcParams["svg.fonttype"] = "none"  # text as text: a third of the size

LEVELS = (1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10)
PROFILE_LEVELS = (1e-2, 1e-4, 1e-8)
FLOOR = 1e-16  # of the axis
N_COLUMNS = 13
FAULTS = (("overlap", "overlap [m]"), ("gap", "gap of a joint [m]"), ("gain", "energy above the start [J]"), ("first", "first step [s]"))

HEAD = """# Error against run time

Each scene is stepped by every integrator, order and tolerance of carom, and by the peers, at 15 to 1920 steps per second (960 in a quick
run). Error: of one body's pose at the end, or the largest over time of what should rest, an angle times its size [m]. Cost: processor seconds per simulated second, the median of the rounds, without the
first step; one thread, everything in one run. `tolerance` runs at 60 steps per second with tolerances of 1e-2 to 1e-12 m. References are closed forms, or, for curved
motion, equations of motion of their own in minimal coordinates, apart from carom (`bench/precision/references.c`: long double, order 4, events by bisection, 8000 and 16000 steps);
the least error shown is a thousand times what those two differ by. Scenes named by a file are those of `tests/data/scenes`, without the piles, which have no reference.
A curve ends where a run takes too long. Box2D runs 8 velocity and 3 position iterations, Chipmunk 10, both also four and sixteen times as many (x4, x16); pymunk is Chipmunk. MuJoCo, where it is installed, runs its stiffest stable contact (`bench/precision/peers.py`); it has no restitution.

![Error against processor seconds per simulated second](precision.svg)

Cheapest cost [s per s] at which an error [m] is reached, and by what; `located` is order 2, the default:
"""


def read(path):
    with open(path, encoding="ascii", errors="replace") as file:
        # what Chipmunk says of itself has no such number of commas
        lines = [line for line in file if line.count(",") == N_COLUMNS - 1]
    rows = []
    for r in csv.DictReader(lines):
        for key in ("rate", "tolerance", "error", "cost", "least", "most", "overlap", "gap", "gain", "first"):
            r[key] = float(r[key])
        r["status"] = int(r["status"])
        rows.append(r)
    return rows


def names(rows, key):
    return list(dict.fromkeys(r[key] for r in rows))


def is_own(name):
    return name.startswith("carom")


def save(figure, out, name):
    figure.tight_layout()
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(out, f"{name}.{kind}"), dpi=80)
    plt.close(figure)


def draw(rows, out):
    scenes = names(rows, "scene")
    height = (len(scenes) + 2) // 3
    figure, axes = plt.subplots(height, 3, figsize=(13, 3.3 * height), sharey=True, squeeze=False)
    for axis in axes.flat[len(scenes):]:
        axis.set_visible(False)
    for axis, scene in zip(axes.flat, scenes):
        for name in names(rows, "contender"):
            mine = [r for r in rows if (r["scene"], r["contender"]) == (scene, name)]
            if not mine:
                continue
            style = "-o" if is_own(name) else "--s"
            axis.loglog([r["cost"] for r in mine], [max(r["error"], FLOOR) for r in mine], style,
                        markersize=3, label=name)
        axis.set_title(scene, fontsize=9)
        axis.grid(alpha=0.3)
    axes.flat[0].legend(fontsize=6)
    figure.supxlabel("processor seconds per simulated second", fontsize=9)
    figure.supylabel("error at the end [m]", fontsize=9)
    save(figure, out, "precision")


def cheapest(rows, scene, level, own=None, name=None):
    """(cost, contender) of the cheapest setting that reaches the level, or None."""
    reached = [(r["cost"], r["contender"]) for r in rows
               if r["scene"] == scene and r["error"] <= level and r["status"] >= 0
               and (own is None or is_own(r["contender"]) == own)
               and (name is None or r["contender"] == name)]
    return min(reached, default=None)


def profile(rows, out):
    """Share of scenes in which a contender reaches the level at no more than x times the least cost."""
    scenes = names(rows, "scene")
    figure, axes = plt.subplots(1, len(PROFILE_LEVELS), figsize=(13, 3.6), sharey=True)
    for axis, level in zip(axes, PROFILE_LEVELS):
        for name in names(rows, "contender"):
            ratios = []
            for scene in scenes:
                best = cheapest(rows, scene, level)
                mine = cheapest(rows, scene, level, name=name)
                if best and mine:
                    ratios.append(mine[0] / best[0])
            ratios.sort()
            xs = [1] + [x for r in ratios for x in (r, r)] + [1000]
            shares = [k / len(scenes) for k in range(len(ratios) + 1) for _ in (0, 1)]
            axis.semilogx(xs, shares, "-" if is_own(name) else "--", label=name)
        axis.set_title(f"error below {level:.0e} m", fontsize=9)
        axis.set_xlabel("cost over the least", fontsize=8)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of scenes", fontsize=8)
    axes[-1].legend(fontsize=6)
    save(figure, out, "profile")


def table(rows):
    lines = ["| scene | " + " | ".join(f"{level:.0e}" for level in LEVELS) + " |",
             "|---" * (len(LEVELS) + 1) + "|"]
    for scene in names(rows, "scene"):
        for own in (True, False):
            cells = []
            for level in LEVELS:
                found = cheapest(rows, scene, level, own)
                cells.append(f"{found[0]:.1e} {found[1].replace('carom ', '')}" if found else "-")
            lines.append(f"| {scene}, {'carom' if own else 'peers'} | " + " | ".join(cells) + " |")
    return lines


def shown(x):
    return "-" if x != x else f"{x:.1e}"


def faults(rows):
    """Largest of each fault at 60 steps per second by scene and contender."""
    lines = ["| scene | contender | " + " | ".join(title for _, title in FAULTS) + " |", "|---|---|---|---|---|---|"]
    for scene in names(rows, "scene"):
        for name in names(rows, "contender"):
            if name not in ("carom euler", "carom located") and is_own(name):
                continue
            mine = [r for r in rows if (r["scene"], r["contender"], r["rate"]) == (scene, name, 60)]
            if mine:
                lines.append(f"| {scene} | {name} | " + " | ".join(shown(mine[0][key]) for key, _ in FAULTS) + " |")
    return lines


def resolved(path):
    """What the references of curved motion do not resolve, as bench_precision says."""
    mark = ": errors below "
    with open(path, encoding="ascii", errors="replace") as file:
        pairs = [line[2:].split(mark) for line in file if line.startswith("# ") and mark in line]
    return ", ".join(f"{scene} {rest.split()[0]} m" for scene, rest in pairs if float(rest.split()[0]) > 0)


def said(rows):
    """Runs that a status calls less than OK, or that failed."""
    lines = [f"* {r['scene']}, {r['contender']}, {r['rate']:.0f} steps per second: status {r['status']}"
             for r in rows if r["status"] != 0]
    return lines or ["* none"]


def spread(rows):
    ratios = sorted(r["most"] / r["least"] for r in rows if r["least"] > 0)
    return ratios[len(ratios) // 2], ratios[-1]


def main(path, out):
    rows = read(path)
    draw(rows, out)
    profile(rows, out)
    middle, worst = spread(rows)
    lines = [HEAD, *table(rows), "",
             f"Least errors shown, by what the references resolve: {resolved(path)}.", "",
             f"Most over least cost of the rounds of a setting: {middle:.2f} in the median, {worst:.2f} at worst.",
             "", "![Performance profile](profile.svg)", "",
             "Faults apart from the error, largest over time, and the first step, which the cost leaves out, at 60 steps per second:", "", *faults(rows), "", "Settings that were not plainly `CAROM_OK`:", "",
             *said(rows)]
    with open(os.path.join(out, "precision.md"), "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
