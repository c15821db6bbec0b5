"""Maps of the stability atlas and its page from the CSV of bench_stability.

usage: plot.py CSV OUTDIR  (writes stability-<family>.png, and stability.md)"""

import csv
import os
import sys
from collections import Counter, defaultdict

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch
from PIL import Image  # comes with matplotlib

COLORS_OF_A_MAP = 64

COLORS = ("green", "yellow", "red", "black", "none")
SHADES = ("#6abf69", "#f2cf4a", "#d9534f", "#1a1a1a", "#e8e8e8")
PEERS = ("Box2D 2.4", "Chipmunk 7")
N_COLUMNS = 19

CRITERIA = """| what | `located`, `order 6` | `fixed`, `euler`, peers |
|---|---|---|
| numbers | finite | finite |
| overlap of two bodies, by separating axes | 1e-6 L | 0.05 L |
| drift of a hinge's two anchors | 1e-8 L | 0.05 L |
| energy of a passive scene above its least before, of what moves or has been lost | 0.02 + (h w)^2 | 0.05 + (h w)^2 + 2 h g / v |
| distance from what is known of the scene | below | below, rough |
| gradient of a free body's end by its velocity against one-sided differences that agree | 1e-3 | 1e-3, peers have none |

L is the largest diameter, h the step, w the fastest turn (its square counts 1 at most), v the speed of the energy; lengths
add 64 roundings of the largest coordinate."""

COLOR_WORDS = """* **green**: all criteria hold, no status said anything.
* **yellow**: all hold, and a positive status said that something was met with a caveat.
* **red**: one does not hold, and a status said so; or the step was refused.
* **black**: one does not hold, and every status was `CAROM_OK`, or a single silent step gave that energy; or the process crashed, or a step did not end.
* gray: the contender cannot run the scene (joints with limits and motors, polygons of more than 8 corners).

Peers have no status: what fails is black."""


def read(path):
    notes, lines = {}, []
    with open(path, encoding="ascii", errors="replace") as file:
        for line in file:
            if line.startswith("# "):
                name, known, hard = line[2:].rstrip("\n").split(" | ")
                notes[name] = (known, hard)
            elif line.count(",") == N_COLUMNS - 1:
                lines.append(line)
    return notes, list(csv.DictReader(lines))


def slug(name):
    return "stability-" + name.lower().replace(" ", "-")


def draw(family, rows, out):
    engines = list(dict.fromkeys(r["engine"] for r in rows))
    xs = sorted({float(r["x"]) for r in rows})
    ys = sorted({float(r["y"]) for r in rows})
    width = 1.2 + 0.32 * len(xs)
    figure, axes = plt.subplots(1, len(engines), sharey=True, squeeze=False,
                                figsize=(max(1.9, width) * len(engines) + 1, 1.6 + 0.3 * len(ys)))
    for axis, engine in zip(axes[0], engines):
        grid = [[COLORS.index("none")] * len(xs) for _ in ys]
        for r in rows:
            if r["engine"] == engine:
                i, j = xs.index(float(r["x"])), ys.index(float(r["y"]))
                grid[j][i] = COLORS.index(r["color"])
                if int(r["steps"]) < int(r["of"]) and r["color"] != "none":
                    axis.text(i, j, "cut" if r["color"] != "red" else "end", fontsize=4,
                              ha="center", va="center")
        axis.imshow(grid, cmap=ListedColormap(SHADES), vmin=-0.5, vmax=len(COLORS) - 0.5,
                    origin="lower", aspect="auto", interpolation="nearest")
        axis.set_xticks(range(len(xs)), [f"{x:g}" for x in xs], rotation=90, fontsize=6)
        axis.set_yticks(range(len(ys)), [f"{y:g}" for y in ys], fontsize=6)
        axis.set_title(engine, fontsize=8)
        axis.set_xlabel(rows[0]["x_name"], fontsize=7)
    axes[0][0].set_ylabel(rows[0]["y_name"], fontsize=7)
    figure.legend(handles=[Patch(color=s, label=c) for c, s in zip(COLORS, SHADES)],
                  loc="upper right", fontsize=5, ncol=5, frameon=False)
    figure.suptitle(family, fontsize=9, x=0.02, ha="left")
    figure.tight_layout(rect=(0, 0, 1, 0.95))
    # forty maps: few colors keep them small
    path = os.path.join(out, f"{slug(family)}.png")
    figure.savefig(path, dpi=110)
    with Image.open(path) as image:
        image.convert("RGB").quantize(COLORS_OF_A_MAP).save(path, optimize=True)
    plt.close(figure)


def counts(rows, engine):
    c = Counter(r["color"] for r in rows if r["engine"] == engine)
    ran = sum(n for color, n in c.items() if color != "none")
    if not ran:
        return "-"
    if engine in PEERS:
        return f"{c['green']} of {ran}"
    return " / ".join(str(c[color]) for color in COLORS[:4])


def summary(families, engines, notes):
    yield "| family | known | " + " | ".join(engines) + " |"
    yield "|---" * (len(engines) + 2) + "|"
    for family, rows in families.items():
        known = notes.get(family, ("", ""))[0] or "-"
        cells = [counts(rows, e) for e in engines]
        yield f"| [{family}]({slug(family)}.png) | {known} | " + " | ".join(cells) + " |"


def worst(rows, key):
    values = [float(r[key]) for r in rows if r["color"] == "green" and float(r[key]) >= 0]
    return f"{max(values):.1e}" if values else "-"


def figures(families):
    """The largest figures in green cells: what a silent status was worth."""
    yield "| family | residual | overlap [L] | drift [L] | energy gained | error | gradient |"
    yield "|---|---|---|---|---|---|---|"
    for family, rows in families.items():
        own = [r for r in rows if r["engine"] == "located"]
        keys = ("residual", "overlap", "drift", "gain", "error", "gradient")
        yield f"| {family} | " + " | ".join(worst(own, k) for k in keys) + " |"


def failures(families, notes, color):
    """Cells of a color, of one family, method and kind of failure together."""
    yield "| family | method | cells | where | what was seen | cause |"
    yield "|---|---|---|---|---|---|"
    for family, rows in families.items():
        groups = defaultdict(list)
        for r in rows:
            if r["color"] == color and r["engine"] not in PEERS:
                what = r["why"].split(" ")[0] if ">" in r["why"] else r["why"]
                groups[(r["engine"], r["status"], what)].append(r)
        for (engine, status, what), cells in groups.items():
            xs = sorted({float(r["x"]) for r in cells})
            ys = sorted({float(r["y"]) for r in cells})
            where = (f"{cells[0]['x_name']} {xs[0]:g} .. {xs[-1]:g}, "
                     f"{cells[0]['y_name']} {ys[0]:g} .. {ys[-1]:g}")
            cause = notes.get(family, ("", ""))[1] or "-"
            seen = cells[0]["why"] if len(cells) == 1 else what
            yield f"| {family} | {engine} | {len(cells)} | {where} | {seen}; {status} | {cause} |"


def page(families, engines, notes):
    everything = [r for rows in families.values() for r in rows]
    total = Counter(r["color"] for r in everything if r["engine"] not in PEERS)
    cut = sum(1 for r in everything if int(r["steps"]) < int(r["of"])
              and r["color"] in ("green", "yellow"))
    yield "# The stability atlas\n"
    yield ("Maps of stiff and extreme cases, every cell judged from the poses alone, whatever the "
           "library said of itself. Made by `bench_stability` and `bench/stability/plot.py`.\n")
    yield "## Colors\n\n" + COLOR_WORDS + "\n"
    yield "## Criteria\n\n" + CRITERIA + "\n"
    yield ("## Counts\n\ngreen / yellow / red / black; of peers the cells within the rough "
           f"criteria. Carom in all: {total['green']} green, {total['yellow']} yellow, "
           f"{total['red']} red, {total['black']} black. {cut} cells were cut by their time limit "
           "and judged where they stood.\n")
    yield from summary(families, engines, notes)
    yield "\n## Largest figures in green cells of `located`\n"
    yield from figures(families)
    yield "\n## Red cells\n"
    yield from failures(families, notes, "red")
    yield "\n## Black cells\n"
    if total["black"]:
        yield from failures(families, notes, "black")
    else:
        yield "None."


def main():
    notes, rows = read(sys.argv[1])
    out = sys.argv[2]
    os.makedirs(out, exist_ok=True)
    families = defaultdict(list)
    for r in rows:
        families[r["family"]].append(r)
    engines = list(dict.fromkeys(r["engine"] for r in rows))
    for family, cells in families.items():
        draw(family, cells, out)
    with open(os.path.join(out, "stability.md"), "w", encoding="ascii") as file:
        file.write("\n".join(page(families, engines, notes)) + "\n")


main()
