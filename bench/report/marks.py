"""carom beside every mark: cost [s per simulated second] at which an error is reached.

usage: marks.py PRECISION_CSV OUTDIR  (writes marks.md)

marks.csv holds the costs of the best of Box2D 2.4 and v3.2, pymunk, MuJoCo and Drake as they were
measured on another day, in one run on a two-core machine, before carom was there; no row: none of them
reached that error.  The peers of this run stand beside them: their ratio to carom's cost decides."""

import csv
import importlib.util
import os
import sys

HERE = os.path.dirname(os.path.abspath(__file__))

HEAD = """# Marks

Cost in processor seconds per simulated second at which an error is reached. *Mark*: the best of Box2D 2.4 and v3.2, pymunk 7.3, MuJoCo 4.0 and Drake 1.51, measured
on another day on two cores of the same kind (`bench/report/marks.csv`); *peers*: the best of the peers of this run, the ratio to which decides; "-": not
reached by any setting.

| scene | error | mark | peers now | carom | by | carom over peers | |
|---|---|---|---|---|---|---|---|
"""


def precision_plot():
    path = os.path.join(HERE, "..", "precision", "plot.py")
    spec = importlib.util.spec_from_file_location("precision_plot", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def verdict(mark, peers, own):
    if own is None:
        return "lost" if mark or peers else "open"
    rival = peers if peers is not None else mark
    return "won" if rival is None or own <= rival else "lost"


def number(x):
    return "-" if x is None else f"{x:.1e}"


def steps(out):
    """Time per step beside the marks, from the page of bench_step; none when that has not run."""
    path = os.path.join(out, "step.md")
    if not os.path.exists(path):
        return []
    found = {}
    with open(path, encoding="ascii") as file:
        for line in file:
            cells = [c.strip() for c in line.strip().strip("|").split("|")]
            if len(cells) > 3 and cells[2][:1].isdigit():
                found.setdefault(cells[0], {})[cells[1]] = float(cells[2])
    lines = ["", "## Microseconds per step", "",
             "Marks as they were measured another day; Box2D 2.4 and Chipmunk of this run beside them.", "",
             "| scene | mark | by | Box2D 2.4 | Chipmunk 7 | carom | by | carom over the best peer now | |",
             "|---|---|---|---|---|---|---|---|---|"]
    with open(os.path.join(HERE, "step_marks.csv"), encoding="ascii") as file:
        for m in csv.DictReader(file):
            times = found.get(m["scene"])
            if not times:
                continue
            own, name = min((t, n) for n, t in times.items() if n.startswith("carom"))
            peers = [t for n, t in times.items() if not n.startswith("carom")]
            best = min(peers, default=float(m["microseconds"]))
            cells = [m["scene"], m["microseconds"], m["who"], *(f"{times[p]:.3g}" if p in times else "-" for p in
                     ("Box2D 2.4", "Chipmunk 7")), f"{own:.3g}", name, f"{own / best:.2f}",
                     "won" if own <= best else "lost"]
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def table_of(name):
    with open(os.path.join(HERE, name), encoding="ascii") as file:
        return list(csv.DictReader(file))


def error_at(rows, scene, name, rate=60):
    """(error, status) of a contender in a scene, or None."""
    found = [(r["error"], r["status"]) for r in rows if (r["scene"], r["contender"], r["rate"]) == (scene, name, rate)]
    return found[0] if found else None


def failures(rows):
    """Where peers failed outright, beside errors [m] of this run at 60 steps per second with the defaults."""
    peers = [name for name in dict.fromkeys(r["contender"] for r in rows) if not name.startswith("carom") and " x" not in name]
    lines = ["", "## Where peers fail outright", "",
             "As measured on another day; then errors [m] of this run at 60 steps per second with what each comes with.", "",
             f"| scene | who | what | {' | '.join(peers)} | carom located | |", "|---" * (5 + len(peers)) + "|"]
    for m in table_of("failure_marks.csv"):
        own = error_at(rows, m["scene"], "carom located")
        errors = [error_at(rows, m["scene"], name) for name in peers]
        if own:
            others = " | ".join(f"{e[0]:.1e}" if e else "-" for e in errors)
            holds = own[1] == 0 and all(not e or own[0] <= e[0] for e in errors)
            lines.append(f"| {m['scene']} | {m['who']} | {m['what']} | {others} | {own[0]:.1e} | {'won' if holds else 'lost'} |")
    return lines


def gradients(out):
    """Errors and costs of gradients beside the marks, from gradient.csv; none when that has not run."""
    path = os.path.join(out, "gradient.csv")
    if not os.path.exists(path):
        return []
    with open(path, encoding="ascii") as file:
        rows = [r for r in csv.DictReader(line for line in file if not line.startswith("#"))
                if r["engine"].startswith("carom")]
    lines = ["", "## Gradients", "", "Relative error of a derivative that has a closed form; carom: the worst of its steps.", "",
             "| scene | by | mark | who | carom | |", "|---|---|---|---|---|---|"]
    for m in table_of("gradient_marks.csv"):
        errors = [float(r["error"]) for r in rows
                  if (r["part"], r["scene"], r["what"]) == ("closed", m["scene"], m["what"])]
        if errors:
            own = max(errors)
            lines.append(f"| {m['scene']} | {m['what']} | {m['error']} | {m['who']} | {own:.1e} | "
                         f"{'won' if own <= float(m['error']) else 'lost'} |")
    lines += ["", "Microseconds per step beside the engine of the paper (de Avila Belbute-Peres et al., 2018); gradient: forward and backward by every parameter.", "",
              "| scene | mark, forward | mark, with gradient | carom, forward | carom, with gradient | by | |",
              "|---|---|---|---|---|---|---|"]
    for m in table_of("gradient_cost_marks.csv"):
        cost = {(r["engine"], r["what"]): 1e6 * float(r["seconds"]) for r in rows
                if (r["part"], r["scene"]) == ("cost", m["scene"])}
        for engine in dict.fromkeys(e for e, _ in cost):
            forward, backward = cost.get((engine, "forward")), cost.get((engine, "backward by all"))
            if forward is None or backward is None:
                continue
            both = cost.get((engine, "recorded"), forward) + backward
            won = forward <= float(m["forward"]) and both <= float(m["gradient"])
            lines.append(f"| {m['scene']} | {m['forward']} | {m['gradient']} | {forward:.3g} | {both:.3g} | "
                         f"{engine} | {'won' if won else 'lost'} |")
    return lines


def main(path, out):
    plot = precision_plot()
    rows = plot.read(path)
    with open(os.path.join(HERE, "marks.csv"), encoding="ascii") as file:
        marks = list(csv.DictReader(file))
    lines, won, lost = [], 0, 0
    for m in marks:
        level = float(m["level"])
        own = plot.cheapest(rows, m["scene"], level, True)
        peers = plot.cheapest(rows, m["scene"], level, False)
        costs = [x[0] if x else None for x in (peers, own)]
        word = verdict(float(m["cost"]), *costs)
        won += word == "won"
        lost += word == "lost"
        ratio = f"{costs[1] / costs[0]:.2f}" if all(costs) else "-"
        lines.append(f"| {m['scene']} | {m['level']} | {float(m['cost']):.1e} | {number(costs[0])} | "
                     f"{number(costs[1])} | {own[1] if own else '-'} | {ratio} | {word} |")
    closing = (f"\n{won} won, {lost} lost. Where the peers of this run do not reach an error, the mark stands for them.\n\n"
               "Errors below these marks, and scenes with none, are in precision.md: carom alone reaches them.\n")
    with open(os.path.join(out, "marks.md"), "w", encoding="ascii") as file:
        file.write(HEAD + "\n".join(lines) + "\n" + closing + "\n".join(failures(rows) + steps(out) + gradients(out)) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
