"""The mass of a chain, found from how it moves: python -m carom.demo --caromd PATH --out DIR.

The experiment of "End-to-End Differentiable Physics for Learning and Control" (NeurIPS 2018), section
on parameter inference: a chain of ten links hangs from a static hook and is hit by a ball.  The
poses of the links over ten seconds, made with the true mass of the chain, are the data.  Starting
from a wrong mass, each iteration steps the scene in the server and asks it for the gradient of the
squared pose error.

The server gives partial derivatives by the mass and inertia of each link.  Both follow the one
unknown, the total mass m: m_i = m/10, I_i = m_i (w^2 + h^2)/12, so dL/dlog m = sum_i (m_i dL/dm_i +
I_i dL/dI_i).  The step is Gauss and Newton's for one parameter and data that can be met exactly:
with L = |r|^2 and r ~ J d the change that cancels r is d = -J'r/J'J = -2 L/(dL/dlog m).
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .client import Client
from .errors import CaromError
from .scene import Scene
from .server import Server
from .shapes import box, circle

LINKS = 10
WIDTH, HEIGHT, SPACING = 0.2, 0.6, 0.5  # of a link, and between pins [m]
BALL_MASS, BALL_RADIUS = 3.0, 0.2  # [kg], [m]
BALL_SPEED, BALL_GAP = 12.0, 0.3  # the push: it starts 0.3 m beside the last link at 12 m/s
FRICTION, RESTITUTION = 0.5, 0.5
DT, STEPS = 1 / 30, 300  # 10 s
TRUE_MASS, START_MASS = 7.0, 0.5  # of the whole chain [kg]
ITERATIONS = 40  # at most
GOOD = 1e-6  # relative step at which the search ends
LONGEST_STEP = 1.0  # of log m
PAPER_FORWARD, PAPER_BOTH = 2.5e-3, 9e-3  # the paper's engine on this scene [s per step]


def chain_scene(mass):
    """Hook, ten links of `mass` in all, and the ball on its way."""
    material = {"friction": FRICTION, "restitution": RESTITUTION}
    # The paper's integrator: its damping keeps ten seconds of a flung chain from becoming chaotic.
    scene = Scene("chain", gravity=(0, -10), dt=DT, duration=STEPS * DT,
                  settings={"integrator": "euler"})
    above = scene.static(box(WIDTH, WIDTH), collide=False, name="hook")
    for k in range(LINKS):
        link = scene.dynamic(box(WIDTH, HEIGHT), position=(0, -SPACING * (k + 0.5)),
                             mass=mass / LINKS, name=f"link {k + 1}", **material)
        scene.pin(above, link, (0, -SPACING * k))
        above = link
    x = -(WIDTH / 2 + BALL_GAP + BALL_RADIUS)
    scene.dynamic(circle(BALL_RADIUS), position=(x, link.position[1]), velocity=(BALL_SPEED, 0),
                  mass=BALL_MASS, name="ball", **material)
    return scene


def links_of(scene):
    return [body.index for body in scene.bodies if body.name.startswith("link")]


@dataclass
class Clock:
    """Time spent, per step of a run: in the server, and as the client sees it."""

    steps: int = 0
    forward: float = 0.0
    backward: float = 0.0
    forward_seen: float = 0.0
    backward_seen: float = 0.0

    def lines(self):
        n = max(self.steps, 1)
        forward, backward = self.forward / n, self.backward / n
        seen, both_seen = self.forward_seen / n, (self.forward_seen + self.backward_seen) / n
        return [
            f"forward            {1e3 * forward:8.4f} ms per step  (with LCM and Python "
            f"{1e3 * seen:.4f} ms); the paper's engine: {1e3 * PAPER_FORWARD:g} ms, "
            f"{PAPER_FORWARD / forward:.0f} times as long",
            f"with its gradient  {1e3 * (forward + backward):8.4f} ms per step  (with LCM and Python "
            f"{1e3 * both_seen:.4f} ms); the paper's engine: {1e3 * PAPER_BOTH:g} ms, "
            f"{PAPER_BOTH / (forward + backward):.0f} times as long",
            f"one gradient       {1e3 * backward * STEPS:8.2f} ms for {STEPS} steps"]


@dataclass
class Search:
    """The masses tried, with their losses."""

    masses: list = field(default_factory=list)
    losses: list = field(default_factory=list)
    poses: list = field(default_factory=list)  # (steps, bodies, 3) of each


def run(client, mass, clock, record):
    """Poses (steps, bodies, 3) of the scene with this mass."""
    scene = chain_scene(mass)
    client.open(scene)
    start = time.perf_counter()
    states = client.step(STEPS, every=1, record=record)
    clock.forward_seen += time.perf_counter() - start
    clock.forward += client.seconds
    clock.steps += STEPS
    return scene, np.array([state.q for state in states])


def loss_and_slope(client, mass, data, clock):
    """L = mean of |pose - data|^2 over links and steps (angle, x, y), and dL/dlog(mass)."""
    scene, poses = run(client, mass, clock, record="restart")
    links = links_of(scene)
    error = np.zeros_like(poses)
    error[:, links] = poses[:, links] - data[:, links]
    scale = 1 / (STEPS * len(links))
    loss = scale * float(np.sum(error**2))
    start = time.perf_counter()
    gradient = client.gradient({k + 1: (2 * scale * error[k], None) for k in range(STEPS)},
                               wrt=("mass", "inertia"), cost=loss)
    clock.backward_seen += time.perf_counter() - start
    clock.backward += gradient.seconds
    masses, inertias = scene.masses()
    slope = masses[links] @ gradient.mass[links] + inertias[links] @ gradient.inertia[links]
    return loss, float(slope), poses


def infer(client, data, clock, show, start=START_MASS):
    """The search: Gauss-Newton steps in log m, halved while they do not lower the loss."""
    search = Search()
    best, step = math.log(start), 0.0
    best_loss, best_slope = math.inf, 0.0
    for k in range(ITERATIONS):
        mass = math.exp(best + step)
        loss, slope, poses = loss_and_slope(client, mass, data, clock)
        search.masses.append(mass)
        search.losses.append(loss)
        search.poses.append(poses)
        show(k, loss, mass)
        if loss < best_loss:
            best, best_loss, best_slope = best + step, loss, slope
            if best_slope == 0:
                break
            step = -2 * best_loss / best_slope
            step = max(-LONGEST_STEP, min(LONGEST_STEP, step))
        else:
            step /= 2
        if abs(step) < GOOD:
            break
    return search, math.exp(best)


def progress(k, loss, mass):
    """One line that is written over on a terminal, one line an iteration elsewhere."""
    bar = "#" * (20 * (k + 1) // ITERATIONS)
    end = "\r" if sys.stdout.isatty() else "\n"
    print(f"iteration {k + 1:2d} [{bar:<20}] loss {loss:.3e}  mass {mass:.6f} kg ", end=end,
          flush=True)


def picture(path, data, search):
    """Chain before and after the search over the data, loss and mass by iteration."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from .plot import draw_scene, plot_convergence

    scene = chain_scene(TRUE_MASS)
    links = links_of(scene)
    apart = np.abs(search.poses[0][:, links] - data[:, links])[:, :, 1:].max(axis=(1, 2))
    k = int(apart.argmax())  # where start and data differ most
    figure = plt.figure(figsize=(13, 7))
    grid = figure.add_gridspec(2, 3)
    last = int(np.argmin(search.losses))
    for column, i, word in ((0, 0, "before"), (1, last, "after")):
        axes = figure.add_subplot(grid[:, column])
        draw_scene(axes, scene, search.poses[i][k], color="#3b6ea5", alpha=0.5,
                   label=f"mass {search.masses[i]:.4g} kg")
        draw_scene(axes, scene, data[k], color="#c0392b", fill=False, label="data")
        axes.set_title(f"{word}, t = {(k + 1) * DT:.2f} s")
        axes.set_xlim(-3, 3)
        axes.set_ylim(-6, 2)
        axes.legend(loc="upper right")
    plot_convergence(figure.add_subplot(grid[0, 2]), figure.add_subplot(grid[1, 2]), search.losses,
                     search.masses, TRUE_MASS, "mass [kg]")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def demo(caromd, out):
    """The whole experiment; 0 when the mass was found within 1 %."""
    clock = Clock()
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CaromError(f"{out}: the picture cannot go there: {error.strerror}") from None
    with Server(caromd) as server, Client(server.url) as client:
        print(f"caromd at {server.url}")
        print(f"chain of {LINKS} links, {TRUE_MASS:g} kg, hit by a ball of {BALL_MASS:g} kg at "
              f"{BALL_SPEED:g} m/s; {STEPS} steps of 1/{1 / DT:.0f} s; start at {START_MASS:g} kg")
        _, data = run(client, TRUE_MASS, Clock(), record=False)
        search, mass = infer(client, data, clock, progress)
    error = abs(mass / TRUE_MASS - 1)
    print(f"\nmass {mass:.9g} kg after {len(search.masses)} iterations, off by {100 * error:.2g} %")
    print(*clock.lines(), sep="\n")
    picture(out / "chain.png", data, search)
    print(f"picture: {out / 'chain.png'}")
    return 0 if error < 0.01 else 1


def main():
    parser = argparse.ArgumentParser(prog="carom.demo", description=__doc__.splitlines()[0])
    parser.add_argument("--caromd", default="caromd", help="the server's program")
    parser.add_argument("--out", default="out/demo", type=Path, help="folder for the picture")
    arguments = parser.parse_args()
    try:
        sys.exit(demo(arguments.caromd, arguments.out))
    except CaromError as error:
        sys.exit(f"carom.demo: {error}")
    except KeyboardInterrupt:
        sys.exit("\ncarom.demo: interrupted")


if __name__ == "__main__":
    main()
