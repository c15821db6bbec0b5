"""Pictures with matplotlib: scenes and errors."""

from __future__ import annotations

import math

import numpy as np

COLORS = {"dynamic": "#3b6ea5", "static": "#888888", "kinematic": "#b5803a"}


def outline(shape, pose, arc=24):
    """Points of the closed outline of a posed shape, (k, 2); rounding in `arc` pieces a turn."""
    angle, x, y = pose
    v = np.array(shape.vertices, float)
    if shape.radius > 0:
        v = _rounded(v, shape.radius, arc)
    c, s = math.cos(angle), math.sin(angle)
    points = v @ np.array([[c, s], [-s, c]]) + (x, y)
    return np.vstack([points, points[:1]])


def _rounded(v, r, arc):
    """Outline grown by r: an arc at every vertex from the normal before to the normal after."""
    if len(v) == 1:
        t = np.linspace(0, 2 * math.pi, 2 * arc, endpoint=False)
        return v[0] + r * np.column_stack([np.cos(t), np.sin(t)])
    edges = np.roll(v, -1, axis=0) - v
    normal = np.arctan2(-edges[:, 0], edges[:, 1])
    parts = []
    for k, p in enumerate(v):
        turn = (normal[k] - normal[k - 1]) % (2 * math.pi)
        t = normal[k - 1] + np.linspace(0, turn, 2 + int(arc * turn / (2 * math.pi)))
        parts.append(p + r * np.column_stack([np.cos(t), np.sin(t)]))
    return np.vstack(parts)


def draw_scene(axes, scene, q=None, color=None, alpha=1.0, fill=True, label=None):
    """Draws the bodies of a scene at the poses q, (n, 3); at the scene's own without.

    color: of the dynamic bodies.  fill=False: outlines only."""
    q = scene.q() if q is None else np.asarray(q, float).reshape(-1, 3)
    for body in scene.bodies:
        paint = color if color and body.type == "dynamic" else COLORS[body.type]
        for shape in body.shapes:
            points = outline(shape, q[body.index])
            axes.fill(points[:, 0], points[:, 1], fill=fill, facecolor=paint, alpha=alpha,
                      edgecolor="black" if fill else paint, linewidth=0.6 if fill else 1.2,
                      label=label if body.type == "dynamic" else None)
            label = None if body.type == "dynamic" else label
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def plot_errors(axes, work, errors, label=None, xlabel="run time [s]", ylabel="error"):
    """Error against run time (or step size), both logarithmic; zeros are left out."""
    work, errors = np.asarray(work, float), np.asarray(errors, float)
    seen = (work > 0) & (errors > 0)
    axes.loglog(work[seen], errors[seen], marker="o", label=label)
    axes.set_xlabel(xlabel)
    axes.set_ylabel(ylabel)
    axes.grid(True, which="both", linewidth=0.3)


def plot_convergence(upper, lower, losses, values, truth=None, name="value"):
    """Loss (logarithmic) on the upper axes and a parameter on the lower ones, by iteration."""
    k = np.arange(len(losses))
    upper.semilogy(k, losses, marker="o")
    upper.set_ylabel("loss")
    upper.grid(True, linewidth=0.3)
    lower.plot(k, values, marker="o")
    if truth is not None:
        lower.axhline(truth, color="black", linewidth=0.8, linestyle="--")
    lower.set_ylabel(name)
    lower.set_xlabel("iteration")
    lower.grid(True, linewidth=0.3)
