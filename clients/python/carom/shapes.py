"""Convex shapes and their mass properties: circle, capsule, segment, hull, each with a rounding.

A shape is its vertices in the body frame and a radius: the solid is the convex hull of the vertices
grown by the radius.  One vertex: circle.  Two: capsule, or segment when the radius is 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .errors import SceneError


@dataclass(frozen=True)
class Shape:
    kind: str  # "circle", "hull", "capsule" or "segment"
    vertices: tuple[tuple[float, float], ...]  # body frame [m], counterclockwise
    radius: float = 0.0  # [m]

    def to_json(self):
        if self.kind == "circle":
            out = {"type": "circle", "radius": self.radius}
            if self.vertices[0] != (0.0, 0.0):
                out["center"] = list(self.vertices[0])
            return out
        out = {"type": self.kind, "vertices": [list(v) for v in self.vertices]}
        if self.radius:
            out["radius"] = self.radius
        return out

    def moments(self):
        """Area, first moment (x, y) and second moment of area about the origin of the body frame."""
        v = np.array(self.vertices)
        area, first, second = _polygon(v)
        if self.radius > 0:
            for part in _strips(v, self.radius) + _sectors(v, self.radius):
                area += part[0]
                first = first + part[1]
                second += part[2]
        return area, first, second


def circle(radius, center=(0.0, 0.0)):
    return Shape("circle", (_point(center),), float(radius))


def hull(vertices, radius=0.0):
    """Convex polygon with counterclockwise vertices, rounded when radius > 0."""
    return Shape("hull", tuple(_point(v) for v in vertices), float(radius))


def box(width, height, radius=0.0):
    """Rectangle about the origin; a rounding is added outside."""
    x, y = width / 2, height / 2
    return hull([(-x, -y), (x, -y), (x, y), (-x, y)], radius)


def capsule(a, b, radius):
    return Shape("capsule", (_point(a), _point(b)), float(radius))


def segment(a, b):
    return Shape("segment", (_point(a), _point(b)))


def from_json(place, data):
    """The shape of a scene file."""
    if not isinstance(data, dict):
        raise SceneError(f"{place}: must be an object {{...}}")
    keys = {"circle": {"radius", "center"}, "hull": {"vertices", "radius"},
            "capsule": {"vertices", "radius"}, "segment": {"vertices"}}
    kind = data.get("type")
    if kind not in keys:
        raise SceneError(f"{place}.type: must be one of {', '.join(keys)}, is {kind!r}")
    for key in data:
        if key not in keys[kind] | {"type", "reference"} and not key.startswith("_"):
            raise SceneError(f"{place}.{key}: unknown key")
    try:
        if kind == "circle":
            return circle(data["radius"], data.get("center", (0, 0)))
        return Shape(kind, tuple(_point(v) for v in data["vertices"]), float(data.get("radius", 0)))
    except KeyError as missing:
        raise SceneError(f"{place}.{missing.args[0]}: must be given") from None
    except (TypeError, ValueError) as error:
        raise SceneError(f"{place}: {error}") from None


def _point(v):
    x, y = v
    return float(x), float(y)


def _cross(a, b):
    return a[0] * b[1] - a[1] * b[0]


def _polygon(v):
    """Moments of a polygon: sums over the triangles (0, a, b)."""
    area, first, second = 0.0, np.zeros(2), 0.0
    for a, b in zip(v, np.roll(v, -1, axis=0)):
        c = _cross(a, b)
        area += c / 2
        first = first + c / 6 * (a + b)
        second += c / 12 * (a @ a + a @ b + b @ b)
    return area, first, second


def _normals(v):
    """Outer unit normals of the edges k -> k + 1; none for a single vertex."""
    if len(v) == 1:
        return []
    edges = np.roll(v, -1, axis=0) - v
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    return [np.array([e[1], -e[0]]) / length for e, length in zip(edges, lengths)]


def _strips(v, r):
    """Rectangles of width r outside every edge."""
    parts = []
    for k, n in enumerate(_normals(v)):
        a, b = v[k], v[(k + 1) % len(v)]
        parts.append(_polygon(np.array([a, a + r * n, b + r * n, b])))
    return parts


def _sectors(v, r):
    """Circular sectors at the vertices: of angle t, with its centroid 4 r sin(t/2) / (3 t) away."""
    normals = _normals(v)
    if not normals:
        area = math.pi * r * r
        return [(area, area * v[0], area * (v[0] @ v[0]) + area * r * r / 2)]
    parts = []
    for k, p in enumerate(v):
        before, after = normals[k - 1], normals[k]
        t = abs(math.atan2(_cross(before, after), before @ after))
        c, s = math.cos(t / 2), math.sin(t / 2)
        middle = np.array([c * before[0] - s * before[1], s * before[0] + c * before[1]])
        area = t * r * r / 2
        offset = 4 * r * s / (3 * t) * middle if t > 0 else np.zeros(2)
        second = area * (p @ p + 2 * (p @ offset)) + t * r**4 / 4
        parts.append((area, area * (p + offset), second))
    return parts
