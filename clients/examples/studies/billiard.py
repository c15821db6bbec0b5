"""How hard were the balls hit, and how rough are they?  python billiard.py --caromd PATH [--out DIR]

Seen from above, two balls roll into two that rest.  Only positions after the first hit are known.  The
five unknowns, two velocities and the coefficient of friction, are found by gradients of the squared
error through all impacts: steps of BFGS, each with one gradient from the server.  What happens late
depends on what happens early ever more strongly, so the loss takes in the data bit by bit.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from carom import CaromError, Client, Scene, Server, box, circle

RADIUS, HALF, WIDTH = 0.06, 1.0, 0.5  # of a ball; half length and width of the table [m]
BALLS = [(-0.7, 0.0), (0.55, -0.3), (-0.1, 0.06), (0.25, 0.22)]
MOVING = 2  # the first two
STEPS, SEEN = 120, 24  # 2 s; the states after these steps are the data
STAGES = (40, 60, 90, STEPS)  # the loss reaches so far
TRUTH = np.array([1.5, 0.1, -0.9, 0.55, 0.06])  # (vx, vy) of two balls [m/s], friction
START = np.array([1.35, 0.14, -0.8, 0.6, 0.2])
GOOD = 1e-14  # [m^2]: a tenth of a micrometer
ROUNDS = 40  # of a stage, at most


def table(unknowns):
    """The scene, and the number of its first ball."""
    scene = Scene("billiard", gravity=(0, 0), dt=1 / 60)
    cloth = {"friction": unknowns[4], "restitution": 0.9}
    for side in (-1, 1):
        scene.static(box(0.2, 2 * WIDTH), position=(side * (HALF + 0.1), 0), **cloth)
        scene.static(box(2 * HALF, 0.2), position=(0, side * (WIDTH + 0.1)), **cloth)
    for k, place in enumerate(BALLS):
        velocity = unknowns[2 * k:2 * k + 2] if k < MOVING else (0, 0)
        scene.dynamic(circle(RADIUS), position=place, velocity=tuple(velocity), mass=0.17, **cloth)
    return scene, len(scene.bodies) - len(BALLS)


def run(client, unknowns, record=False):
    """Positions (steps, balls, 2)."""
    scene, first = table(unknowns)
    client.open(scene)
    states = client.step(STEPS, record=record)
    return np.array([state.q[first:, 1:] for state in states]), scene, first


def loss_and_gradient(client, unknowns, data, until):
    """Mean squared distance of the balls from the data, and its derivative by the unknowns."""
    places, scene, first = run(client, unknowns, record=True)
    error = places[SEEN:until] - data[SEEN:until]
    scale = 1 / (len(error) * len(BALLS))
    bars = {}
    for k, off in enumerate(error):
        q_bar = np.zeros((len(scene.bodies), 3))
        q_bar[first:, 1:] = 2 * scale * off
        bars[SEEN + k + 1] = (q_bar, None)
    g = client.gradient(bars, wrt=("v0", "friction"))
    slope = np.append(g.v0[first:first + MOVING, 1:].ravel(), g.friction.sum())
    return scale * float(np.sum(error**2)), slope, places


def search(client, data, x, show=lambda *_: None):
    """All stages.  Unknowns, losses and positions by round."""
    history = []
    for until in STAGES:
        history += descend(client, data, x, until, show)
        x = history[-1][0]
    return history


def descend(client, data, x, until, show):
    """BFGS with halved steps; friction stays at 0 or above."""
    inverse = None  # of the second derivative
    loss, slope, places = loss_and_gradient(client, x, data, until)
    history = [(x, loss, places)]
    for k in range(ROUNDS):
        show(until, k, loss, x)
        if loss < GOOD:
            break
        if inverse is None:
            inverse = np.eye(len(x)) * 0.05 / np.linalg.norm(slope)
        step, length = -inverse @ slope, 1.0
        if step @ slope >= 0:
            inverse = None
            continue
        step *= min(1.0, 0.3 / np.linalg.norm(step))
        for _ in range(30):
            at = x + length * step
            at[4] = max(at[4], 0)
            new, new_slope, places = loss_and_gradient(client, at, data, until)
            if new < loss + 1e-4 * length * (step @ slope):
                break
            length /= 2
        else:
            break
        s, y = at - x, new_slope - slope
        x, loss, slope = at, new, new_slope
        history.append((x, loss, places))
        if s @ y > 0:
            left = np.eye(len(x)) - np.outer(s, y) / (s @ y)
            inverse = left @ inverse @ left.T + np.outer(s, s) / (s @ y)
    return history


def picture(path, data, history):
    """Paths of the balls before and after the search over the data; loss and unknowns by round."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from carom.plot import draw_scene

    figure = plt.figure(figsize=(13, 5.4))
    grid = figure.add_gridspec(2, 5)
    colors = ("#c0392b", "#3b6ea5", "#3c8d5a", "#b5803a")
    for row, (word, places) in enumerate((("first guess", history[0][2]), ("found", history[-1][2]))):
        axes = figure.add_subplot(grid[row, :3])
        scene, first = table(TRUTH)
        q = scene.q()
        draw_scene(axes, scene, q, color="#dddddd")
        for k, color in enumerate(colors):
            axes.plot(*places[:, k].T, color=color, lw=1)
            axes.plot(*data[SEEN::6, k].T, "o", color=color, ms=4, mfc="none")
        axes.set_title(f"{word}: paths; circles: the positions that were seen", fontsize=10)
        axes.set_xlabel("")
    axes = figure.add_subplot(grid[0, 3:])
    axes.semilogy([loss for _, loss, _ in history], color="#c0392b", marker=".")
    axes.set_ylabel("loss [m^2]")
    axes = figure.add_subplot(grid[1, 3:])
    off = np.abs([x - TRUTH for x, _, _ in history])
    for k, name in enumerate(("vx 1", "vy 1", "vx 2", "vy 2", "friction")):
        axes.semilogy(np.maximum(off[:, k], 1e-12), label=name)
    axes.set_ylabel("distance from the truth")
    axes.set_xlabel("round")
    axes.legend(fontsize=7, ncol=2)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--caromd", default="caromd", help="the server's program")
    parser.add_argument("--out", type=Path, help="folder for the picture; none: no picture")
    arguments = parser.parse_args()
    with Server(arguments.caromd) as server, Client(server.url) as client:
        data, _, _ = run(client, TRUTH)
        history = search(client, data, START,
                         lambda until, k, loss, x: print(f"steps {SEEN} to {until}, round {k:2d}: "
                                                          f"loss {loss:.3e}, friction {x[4]:.6f}"))
    x = history[-1][0]
    print("velocities and friction:", " ".join(f"{value:.9f}" for value in x))
    print(f"off by {np.abs(x - TRUTH).max():.1e} at most")
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        picture(arguments.out / "billiard.png", data, history)
        print(f"picture: {arguments.out / 'billiard.png'}")
    return 0 if np.abs(x - TRUTH).max() < 1e-3 else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except CaromError as error:
        sys.exit(f"billiard: {error}")
