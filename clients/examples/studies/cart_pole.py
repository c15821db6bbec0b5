"""Draws what cart_pole finds: python cart_pole.py PATH/OF/cart_pole [PICTURE.png]."""

import subprocess
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

POLE = 0.8  # [m]
BLUE, RED, GRAY = "#3b6ea5", "#c0392b", "#888888"


def draw(path, rounds, t, x, angle, force):
    figure = plt.figure(figsize=(13, 4.8))
    grid = figure.add_gridspec(2, 3)
    frames = np.linspace(0, len(t) - 1, 18).astype(int)
    for row in range(2):
        film = figure.add_subplot(grid[row, :2])
        for column, k in enumerate(frames[9 * row:9 * row + 9]):
            middle = 1.5 * column
            hinge = middle + x[k]
            film.plot([middle - 0.65, middle + 0.65], [0, 0], color=GRAY, lw=0.8)
            film.add_patch(plt.Rectangle((hinge - 0.2, -0.1), 0.4, 0.2, color=BLUE))
            film.plot([hinge, hinge + POLE * np.sin(angle[k])], [0, -POLE * np.cos(angle[k])],
                      color=RED, lw=3)
            film.text(middle, -1.1, f"{t[k]:.2f} s", ha="center", color=GRAY, fontsize=8)
        film.set_aspect("equal")
        film.set_ylim(-1.2, 1)
        film.axis("off")
        if row == 0:
            film.set_title(f"swung up in {t[-1]:g} s, in the end "
                           f"{np.degrees(np.pi - angle[-1]):+.3f} degrees from upright", fontsize=10)
    axes = figure.add_subplot(grid[0, 2])
    axes.plot(t[:-1], force[:-1], color=BLUE)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("force on the cart [N]")
    axes = figure.add_subplot(grid[1, 2])
    axes.semilogy(rounds[:, 0], rounds[:, 1], color=RED, marker=".")
    axes.set_xlabel("round of iterative LQR")
    axes.set_ylabel("cost")
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def main(program, path="cart_pole.png"):
    output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    rows = [line.split(",") for line in output.splitlines()]
    rounds = np.array([row[1:] for row in rows if row[0] == "round"], float)
    t, x, angle, _, _, force = np.array([row[1:] for row in rows if row[0] == "state"], float).T
    print(f"cost {rounds[0, 1]:.4g} -> {rounds[-1, 1]:.4g} in {len(rounds) - 1} rounds")
    print(f"at the end {np.degrees(np.pi - angle[-1]):+.4f} degrees from upright, x = {x[-1]:+.5f} m")
    draw(path, rounds, t, x, angle, force)
    print(f"picture: {path}")


if __name__ == "__main__":
    main(*sys.argv[1:])
