"""Page and figure of gradients from the CSV of bench_gradient, beside peers.csv of peers.py.

usage: plot.py CSV OUTDIR  (writes gradient.md, gradient.svg and .png)"""

import csv
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

PEERS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "peers.csv")
FLOOR = 1e-16  # of the axis

HEAD = """# Gradients: cost and error

`backward by q0` is one reverse pass for the initial poses, `by all` one for every parameter of the scene (state, masses, inertias, frictions, restitutions, gravity, forces
of each step, dt, radii, vertices, anchors); with checkpoints nine tenths of the steps are run again. 60 steps of 1/60 s, one thread, the least of the rounds;
`over forward` is the cost over that of the same steps without a tape.
"""

CLOSED = """
## Closed forms, and peers

A disc of 1 kg on or above a floor. *Sliding stop*: x by the first speed and by the friction. *Drop and slide*: it falls by h, hits, slides to a stop; x by h is exactly the friction.
*Oblique impact*: e = 0, sticks and rolls on; x by h and by the first speed. *Wall bounce*: y by the first distance is -e. In all but the first two the time of impact depends on the
parameter. Error: relative, of the derivative. Rows of peers were measured by `bench/gradient/peers.py` in environments of their own; over forward: a run with its gradient over one without,
for one parameter. `nan`: the result is not a number. What an engine has no parameter for is not in the table (MuJoCo, MJX, Drake: restitution).

![Relative error of derivatives against seconds of a run with its gradient](gradient.svg)

| scene | by | engine | dt [s] | error | seconds | over forward |
|---|---|---|---|---|---|---|
"""


DIFFERENCES = """
## Differences of carom's own runs

Relative error of central differences of whole runs at 1/60 s, by the change of the parameter; over forward: for this one number.
"""

SMOOTHED = """
## Smoothing

Relative error of the derivative when contact problems are differentiated at the central path's kappa [J] (`carom_tape_smooth`), dt = 1/60 s: linear in kappa until the digits end. Over forward: a run
with its gradient over one without.
"""


def read(path):
    with open(path, encoding="ascii") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def comments(path):
    with open(path, encoding="ascii") as file:
        return [line[1:].strip() for line in file if line.startswith("#")]


def cost_table(rows):
    lines = ["", "| scene | integrator | | us per step | over forward | bytes per step |", "|---|---|---|---|---|---|"]
    for r in rows:
        lines.append(f"| {r['scene']} | {r['engine']} | {r['what']} | {1e6 * float(r['seconds']):.3g} | "
                     f"{float(r['over_forward']):.2f} | {r['bytes']} |")
    return lines


def draw(rows, out):
    cases = list(dict.fromkeys((r["scene"], r["what"]) for r in rows))
    engines = list(dict.fromkeys(r["engine"] for r in rows))
    figure, axes = plt.subplots(2, (len(cases) + 1) // 2, figsize=(13, 6), sharey=True, squeeze=False)
    for axis in axes.flat[len(cases):]:
        axis.set_axis_off()
    for axis, case in zip(axes.flat, cases):
        for k, engine in enumerate(engines):
            mine = [r for r in rows if (r["scene"], r["what"], r["engine"]) == (*case, engine)]
            axis.loglog([float(r["seconds"]) for r in mine],
                        [max(float(r["error"]), FLOOR) for r in mine],
                        "o" if engine.startswith("carom") else "s", color=f"C{k}", label=engine)
        axis.set_title(f"{case[0]}, by {case[1]}", fontsize=9)
        axis.grid(alpha=0.3)
    handles, names = axes.flat[0].get_legend_handles_labels()
    spare = axes.flat[-1]
    spare.legend(handles, names, fontsize=7, loc="center" if len(cases) % 2 else "upper right")
    figure.supxlabel("seconds of a run with its gradient", fontsize=9)
    figure.supylabel("relative error of the derivative", fontsize=9)
    figure.tight_layout()
    for kind in ("svg", "png"):
        figure.savefig(os.path.join(out, f"gradient.{kind}"), dpi=80)


def by_setting(own, part, title):
    """A table: scenes and parameters down, settings across."""
    rows = [r for r in own if r["part"] == part]
    settings = list(dict.fromkeys(r["engine"] for r in rows))
    cases = list(dict.fromkeys((r["scene"], r["what"]) for r in rows))
    lines = [title, "| scene | by | " + " | ".join(settings) + " | over forward |", "|---" * (3 + len(settings)) + "|"]
    for case in cases:
        mine = {r["engine"]: r for r in rows if (r["scene"], r["what"]) == case}
        cost = [float(r["over_forward"]) for r in mine.values()]
        lines.append(f"| {case[0]} | {case[1]} | " + " | ".join(mine[s]["error"] if s in mine else "-" for s in settings)
                     + f" | {min(cost):.2g} to {max(cost):.2g} |")
    return lines if rows else []


def main(path, out):
    own = read(path)
    closed = [r for r in own if r["part"] == "closed"]
    lines = [HEAD.rstrip("\n"), *cost_table([r for r in own if r["part"] == "cost"]), CLOSED.rstrip("\n")]
    notes = []
    if os.path.exists(PEERS):
        closed += read(PEERS)
        notes = comments(PEERS)
    order = list(dict.fromkeys((r["scene"], r["what"]) for r in closed))
    closed.sort(key=lambda r: order.index((r["scene"], r["what"])))
    for r in closed:
        lines.append(f"| {r['scene']} | {r['what']} | {r['engine']} | {float(r['dt']):.4g} | {r['error']} | "
                     f"{float(r['seconds']):.1e} | {float(r['over_forward']):.2g} |")
    lines += [""] + [f"* {note}" for note in notes]
    lines += by_setting(own, "differences", DIFFERENCES) + by_setting(own, "smoothed", SMOOTHED)
    with open(os.path.join(out, "gradient.md"), "w", encoding="ascii") as file:
        file.write("\n".join(lines).rstrip("\n") + "\n")
    draw(closed, out)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
