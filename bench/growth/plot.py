"""Figure and page of growth from the CSV of bench_growth.

usage: plot.py CSV OUTDIR  (writes growth.svg and .png, growth.md)"""

import csv
import math
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

plt.rcParams["svg.fonttype"] = "none"  # text as text: a third of the size

N_COLUMNS = 11
FIT_FROM = 100  # bodies; below, constant parts count

HEAD = """# Growth

Wall seconds per step of 1/60 s against the number of bodies, everything in one run. *free*: discs in flight; *chain*: pinned links, let go; *stack*, *pyramid*:
boxes that bear a pendulum, so that every step is another; *pile*: the beginning of a fall of discs into a box; *islands*: stacks of three, each with its pendulum; *rest*: stacks
of four that nothing moves; *hub*: arms pinned to a heavy disc that turns. A curve ends
where the next size would take longer than the budget of a cell (0.1 s in a quick run, else 4 s).

![Seconds per step, bytes and factorizations against bodies](growth.svg)

Exponent: of the time, fitted from 100 bodies on. Factorizations, bytes, fill (numbers in the factors) and flops of one factorization are those of the largest size. Last
column: time of a step over the limit of one factorization, the longer of its bytes at the measured {bandwidth:.1f} GB/s of memory and its flops at the {rate:.1f} Gflop/s that this compiler
reaches in y += a x within the nearest cache. A step has two solves with several products and substitutions each, and looks for contacts.

| family | contender | bodies | seconds | exponent | factorizations | bytes per body | fill per body | flops per body | over the limit |
|---|---|---|---|---|---|---|---|---|---|
"""


def read(path):
    limits, lines = {"bandwidth": math.nan, "arithmetic": math.nan}, []
    with open(path, encoding="ascii", errors="replace") as file:
        for line in file:
            if line.startswith("# ") and line.split()[1] in limits:
                limits[line.split()[1]] = float(line.split()[2])
            elif line.count(",") >= N_COLUMNS - 1:
                lines.append(line)
    rows = list(csv.DictReader(lines))
    for r in rows:
        for key in ("bodies", "contacts", "steps", "bytes", "nonzeros", "flops", "status"):
            r[key] = int(r[key])
        for key in ("seconds", "factorizations"):
            r[key] = float(r[key])
    return limits, rows


def names(rows, key):
    return list(dict.fromkeys(r[key] for r in rows))


def exponent(points):
    """Slope of log time over log bodies."""
    points = [(math.log(r["bodies"]), math.log(r["seconds"])) for r in points if r["bodies"] >= FIT_FROM]
    if len(points) < 2:
        return None
    mx = sum(x for x, _ in points) / len(points)
    my = sum(y for _, y in points) / len(points)
    return sum((x - mx) * (y - my) for x, y in points) / sum((x - mx) ** 2 for x, _ in points)


def draw(rows, out):
    families = names(rows, "family")
    figure, axes = plt.subplots(2, (len(families) + 1) // 2, figsize=(13, 6.5), squeeze=False)
    for axis in axes.flat[len(families):]:
        axis.set_visible(False)
    for axis, family in zip(axes.flat, families):
        for name in names(rows, "contender"):
            mine = [r for r in rows if (r["family"], r["contender"]) == (family, name)]
            style = "-o" if name.startswith("carom") else "--s"
            axis.loglog([r["bodies"] for r in mine], [r["seconds"] for r in mine], style, markersize=3,
                        label=name)
        axis.set_title(family, fontsize=9)
        axis.grid(alpha=0.3)
    axes.flat[0].legend(fontsize=6)
    figure.supxlabel("bodies", fontsize=9)
    figure.supylabel("seconds per step", fontsize=9)
    figure.tight_layout()
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(out, f"growth.{kind}"), dpi=80)
    plt.close(figure)


def line(mine, limits):
    last = mine[-1]
    slope = exponent(mine)
    own = last["contender"].startswith("carom")
    limit = max(8 * last["nonzeros"] / limits["bandwidth"], last["flops"] / limits["arithmetic"])
    return " | ".join([
        f"| {last['family']}", last["contender"], str(last["bodies"]), f"{last['seconds']:.1e}",
        "-" if slope is None else f"{slope:.2f}", f"{last['factorizations']:.2g}" if own else "-",
        f"{last['bytes'] / last['bodies']:.0f}" if own else "-",
        f"{last['nonzeros'] / last['bodies']:.0f}" if own and limit > 0 else "-",
        f"{last['flops'] / last['bodies']:.0f}" if own and limit > 0 else "-",
        f"{last['seconds'] / limit:.0f}" if own and limit > 0 else "-"]) + " |"


def main(path, out):
    limits, rows = read(path)
    draw(rows, out)
    lines = []
    for family in names(rows, "family"):
        for name in names(rows, "contender"):
            mine = [r for r in rows if (r["family"], r["contender"]) == (family, name)]
            if mine:
                lines.append(line(mine, limits))
    with open(os.path.join(out, "growth.md"), "w", encoding="ascii") as file:
        file.write(HEAD.format(bandwidth=limits["bandwidth"] / 1e9, rate=limits["arithmetic"] / 1e9) + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
