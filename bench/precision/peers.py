"""MuJoCo on the scenes of bench_precision, as CSV of the same columns.

usage: bench_precision scene K | peers.py [--quick]

Needs the package mujoco (`./dev report` makes build/peers for it); without it nothing is printed and a
line on stderr says so.  Settings, the stiffest that stay stable at every step: Newton solver with an
elliptic cone to 1e-10 in at most 100 iterations, solref = (2 dt, 1), solimp = (0.99, 0.9999, 1e-3), implicitfast
integrator.  MuJoCo has no restitution: scenes that bounce are its failure, not left out."""

import json
import math
import sys
import time

RATES = (15, 30, 60, 120, 240, 480, 960, 1920)
QUICK_RATES = (15, 60, 240, 960)
MAX_LOOKS = 120
TOO_LONG = 10.0  # [s]; a curve ends there
TOO_LONG_QUICK = 0.5


def geom(body, static):
    """Planar shapes stand on the x-y plane; a static one carries its own pose."""
    where = ""
    if static:
        where = f'pos="{body["q"][1]} {body["q"][2]} 0" euler="0 0 {body["q"][0]}"'
    if body["shape"] == "disc":
        size = f'type="sphere" size="{body["hx"]}"'
    elif body["shape"] == "box":
        size = f'type="box" size="{body["hx"]} {body["hy"]} 0.5"'
    else:
        return ""
    return f'<geom {size} {where} friction="{body["friction"]} 0 0"/>'


def moving(k, body):
    a, x, y = body["q"]
    c, s = math.cos(a), math.sin(a)
    inertia = body["inertia"]
    return (f'<body name="b{k}" pos="{x!r} {y!r} 0" euler="0 0 {a!r}">'
            f'<joint type="slide" axis="{c!r} {-s!r} 0"/><joint type="slide" axis="{s!r} {c!r} 0"/>'
            f'<joint type="hinge" axis="0 0 1"/>'
            f'<inertial pos="0 0 0" mass="{body["mass"]!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
            f'{geom(body, False)}</body>')


def pin(scene, p):
    """Anchored in the frame of its first moving body; an unnamed second body is the world."""
    first, second = (p["a"], p["b"]) if scene["bodies"][p["a"]]["moves"] else (p["b"], p["a"])
    a, x, y = scene["bodies"][first]["q"]
    dx, dy = p["x"] - x, p["y"] - y
    c, s = math.cos(a), math.sin(a)
    other = f'body2="b{second}"' if scene["bodies"][second]["moves"] else ""
    return f'<connect body1="b{first}" {other} anchor="{c * dx + s * dy!r} {c * dy - s * dx!r} 0"/>'


def exclusion(scene, p):
    if not (scene["bodies"][p["a"]]["moves"] and scene["bodies"][p["b"]]["moves"]):
        return ""
    return f'<exclude body1="b{p["a"]}" body2="b{p["b"]}"/>'


def model_of(scene, dt):
    parts = [moving(k, b) if b["moves"] else geom(b, True) for k, b in enumerate(scene["bodies"])]
    soft = f'solref="{2 * dt!r} 1" solimp="0.99 0.9999 0.001"'
    return (f'<mujoco><compiler angle="radian"/><option timestep="{dt!r}" gravity="0 {-scene["gravity"]!r} 0" '
            'cone="elliptic" solver="Newton" tolerance="1e-10" iterations="100" integrator="implicitfast"/>'
            f'<size memory="256M"/><default><geom {soft}/><equality {soft}/></default>'
            f'<worldbody>{"".join(parts)}</worldbody>'
            f'<equality>{"".join(pin(scene, p) for p in scene["pins"])}</equality>'
            f'<contact>{"".join(exclusion(scene, p) for p in scene["pins"])}</contact></mujoco>')


def run(mujoco, scene, rate):
    """(error [m], processor seconds without the first step, those of the first step) of one run."""
    n = int(rate * scene["duration"] + 0.5)
    model = mujoco.MjModel.from_xml_string(model_of(scene, scene["duration"] / n))
    data = mujoco.MjData(model)
    order = [k for k, b in enumerate(scene["bodies"]) if b["moves"]]
    for i, k in enumerate(order):
        omega, vx, vy = scene["bodies"][k]["v"]
        data.qvel[3 * i:3 * i + 3] = (vx, vy, omega)
    start = time.process_time()
    mujoco.mj_step(model, data)
    first = time.process_time() - start
    start = time.process_time()
    mujoco.mj_step(model, data, nstep=n - 1)
    seconds = (time.process_time() - start) * n / (n - 1)
    i = order.index(scene["body"])
    error = error_of(scene, data.qpos[3 * i:3 * i + 3])
    return (watch(mujoco, scene, model, n, order) if scene["rests"] else error), seconds, first


def error_of(scene, moved):
    x, y, angle = moved
    q0, exact = scene["bodies"][scene["body"]]["q"], scene["exact"]
    turn = scene["reach"] * abs(q0[0] + angle - exact[0])
    error = max(turn, math.hypot(q0[1] + x - exact[1], q0[2] + y - exact[2]))
    return max(error, scene["resolved"])


def watch(mujoco, scene, model, n, order):
    """The largest error over time of what should rest: the same run without a clock."""
    data = mujoco.MjData(model)
    i, worst = order.index(scene["body"]), 0.0
    every = (n + MAX_LOOKS - 1) // MAX_LOOKS
    for first in range(0, n, every):
        mujoco.mj_step(model, data, nstep=min(every, n - first))
        error = error_of(scene, data.qpos[3 * i:3 * i + 3])
        worst = max(worst, error) if math.isfinite(error) else math.inf
    return worst


def main():
    try:
        import mujoco
    except ImportError:
        print("peers.py: no mujoco here; its curves are left out", file=sys.stderr)
        return
    quick = "--quick" in sys.argv
    scene = json.load(sys.stdin)
    if any(b["shape"] == "polygon" for b in scene["bodies"]):
        print("peers.py: its planar shapes are spheres and boxes; the scene is left out", file=sys.stderr)
        return
    limit = TOO_LONG_QUICK if quick else TOO_LONG
    print("scene,contender,rate,tolerance,error,cost,least,most,status,overlap,gap,gain,first")
    for rate in QUICK_RATES if quick else RATES:
        times, error = [], math.inf
        while len(times) < (1 if quick else 3):
            error, seconds, first = run(mujoco, scene, rate)
            times.append(seconds / scene["duration"])
        times.sort()
        if not math.isfinite(error):
            error = 1e300
        print(f'{scene["name"]},MuJoCo {mujoco.__version__},{rate},0,{error:.3e},{times[len(times) // 2]:.3e},'
              f"{times[0]:.3e},{times[-1]:.3e},0,nan,nan,nan,{first:.1e}", flush=True)
        if sum(times) > limit:
            return


if __name__ == "__main__":
    main()
