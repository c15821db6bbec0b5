"""Figure and page of what scenes leave out, from the CSV of bench_leave_out.

usage: plot.py CSV OUTDIR  (writes leave_out.svg, leave_out.png and leave_out.md)"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def read(path):
    with open(path, encoding="ascii") as file:
        return list(csv.DictReader(file))


def ratio(row, key):
    a, b = row[key], row[key + "_kept"]
    return float(b) / float(a) if a and b and float(a) > 0 else None


def draw(rows, out):
    figure, axes = plt.subplots(1, 2, figsize=(10, 0.8 + 0.3 * len(rows)), sharey=True)
    names = [f"{r['scene']} ({r['kept']})" for r in rows]
    for axis, key, title in zip(axes, ("instructions", "bytes"),
                                ("instructions per step", "bytes of the world")):
        values = [ratio(r, key) or 0 for r in rows]
        axis.barh(range(len(rows)), values, color="#5b8db8")
        axis.axvline(1, color="black", linewidth=0.8)
        axis.set_xlabel(f"{title}: kept / left out")
        axis.set_yticks(range(len(rows)), names, fontsize=7)
        axis.invert_yaxis() if axis is axes[0] else None
    figure.tight_layout()
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(out, f"leave_out.{kind}"), dpi=100,
                       metadata={"Date": None} if kind == "svg" else None)


def times(row, key):
    r = ratio(row, key)
    return f"{r:.2f}" if r else "-"


def figures(rows):
    yield ("| scene | kept in the second form | us | instructions | x | functions entered | x of time | "
           "bytes | x | message of scene / state | other libraries |")
    yield "|---|---|---|---|---|---|---|---|---|---|---|"
    for r in rows:
        entered = f"{r['functions']} -> {r['functions_kept']}" if r["functions"] else "-"
        message = (f"{r['scene_bytes']} / {r['state_bytes']} -> "
                   f"{r['scene_bytes_kept']} / {r['state_bytes_kept']}")
        if (r["scene_bytes"], r["state_bytes"]) == (r["scene_bytes_kept"], r["state_bytes_kept"]):
            message = f"{r['scene_bytes']} / {r['state_bytes']}"
        yield (f"| {r['scene']} | {r['kept']} | {float(r['us']):.2f} | {r['instructions'] or '-'} | "
               f"{times(r, 'instructions')} | {entered} | {times(r, 'us')} | {r['bytes']} | "
               f"{times(r, 'bytes')} | {message} | {r['libraries'].strip() or '-'} |")


def dropped(rows):
    yield "| scene | the plan drops | functions that only the second form enters |"
    yield "|---|---|---|"
    for r in rows:
        spared = r["spared"].split()
        text = ", ".join(f"`{name}`" for name in spared[:12])
        if len(spared) > 12:
            text += f" and {len(spared) - 12} more"
        yield f"| {r['scene']} | {', '.join(r['dropped'].split())} | {text or '-'} |"


def page(rows):
    yield "# What was left out\n"
    yield ("Each scene as it is, and once more with one thing kept alive that its motion does not "
           "need. Made by `bench_leave_out` and `bench/leave_out/plot.py`. Instructions and functions "
           f"are callgrind's; the libraries have {rows[0]['functions_all']} functions. x: second form "
           "/ first. Microseconds are the least of 7 rounds in one run.\n")
    yield "![kept against left out](leave_out.svg)\n"
    yield from figures(rows)
    yield ""
    yield from dropped(rows)


def main():
    rows = read(sys.argv[1])
    out = sys.argv[2]
    os.makedirs(out, exist_ok=True)
    draw(rows, out)
    with open(os.path.join(out, "leave_out.md"), "w", encoding="ascii") as file:
        file.write("\n".join(page(rows)) + "\n")


main()
