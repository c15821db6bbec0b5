"""What is wrong with a body, a shape or a scene, said where it is made: SceneError with its place.

The rules are those of docs/scene.md.  The server checks them again, and to the last digit whether
a hull is convex; here are the mistakes that people make."""

from __future__ import annotations

import math

from .errors import SceneError

TYPES = ("dynamic", "static", "kinematic")

_LIMITS = ("lower", "upper", "restitution")
_SPRING = ("stiffness", "damping", "rest")
_MOTOR = ("motor_speed", "motor_limit")
# The fields that joints of a type have, beside those of all.
JOINT_KEYS = {
    "revolute": (*_LIMITS, *_SPRING, *_MOTOR),
    "prismatic": ("axis", *_LIMITS, *_SPRING, *_MOTOR),
    "weld": (),
    "wheel": ("axis", *_LIMITS, *_SPRING, *_MOTOR),
    "distance": ("anchor_b",),
    "rope": ("anchor_b", *_LIMITS, *_SPRING),
    "target": _SPRING,
    "lock_x": (), "lock_y": (), "lock_angle": (),
}
# Types whose bodies may touch each other unless `collide` says otherwise.
COLLIDING = ("distance", "rope", "target", "lock_x", "lock_y", "lock_angle")
# Without a value: what leaves a field out.
_PLAIN = {"anchor_b": None, "axis": None, "lower": -math.inf, "upper": math.inf}


def number(place, value, low=-math.inf, above=False, high=math.inf):
    """A finite float from low (or above it) to high."""
    try:
        if isinstance(value, (str, bool)):
            raise TypeError
        x = float(value)
    except (TypeError, ValueError):
        raise SceneError(f"{place}: must be a number, is {value!r}") from None
    if not math.isfinite(x):
        raise SceneError(f"{place}: must be finite, is {x}")
    if x < low or x > high or (above and x == low):
        bound = f"> {low:g}" if above else f">= {low:g}" if high == math.inf else f"{low:g} to {high:g}"
        raise SceneError(f"{place}: must be {bound}, is {x:g}")
    return x


def numbers(place, values, count):
    """A tuple of `count` finite floats."""
    try:
        values = tuple(values)
    except TypeError:
        values = ()
    if len(values) != count:
        raise SceneError(f"{place}: must be {count} numbers")
    return tuple(number(f"{place}[{i}]", x) for i, x in enumerate(values))


def check_shape(place, shape):
    """Radius, number of vertices and their order."""
    low = f"{place}.radius"
    number(low, shape.radius, 0, above=shape.kind in ("circle", "capsule"))
    for i, vertex in enumerate(shape.vertices):
        numbers(f"{place}.vertices[{i}]", vertex, 2)
    n = len(shape.vertices)
    if shape.kind in ("capsule", "segment") and (n != 2 or shape.vertices[0] == shape.vertices[1]):
        raise SceneError(f"{place}.vertices: a {shape.kind} has two different vertices")
    if shape.kind == "hull":
        _check_hull(f"{place}.vertices", shape.vertices)


def _check_hull(place, v):
    n = len(v)
    if n < 3:
        raise SceneError(f"{place}: a hull has three vertices or more, here are {n}")
    area = sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(v, v[1:] + v[:1])) / 2
    if area < 0:
        raise SceneError(f"{place}: the vertices run clockwise; reverse their order")
    if area == 0:
        raise SceneError(f"{place}: the hull has no area")
    for i in range(n):
        (ax, ay), (bx, by), (cx, cy) = v[i - 1], v[i], v[(i + 1) % n]
        if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) <= 0:
            raise SceneError(f"{place}[{i}]: not convex here, or on the line of its neighbors")


def check_body(place, body):
    """Everything but the types of its fields that nothing reads as a number."""
    if body.type not in TYPES:
        raise SceneError(f"{place}.type: must be one of {', '.join(TYPES)}, is {body.type!r}")
    for k, shape in enumerate(body.shapes):
        check_shape(f"{place}.shape" if len(body.shapes) == 1 else f"{place}.shapes[{k}]", shape)
    numbers(f"{place}.position", body.position, 2)
    velocity = numbers(f"{place}.velocity", body.velocity, 2)
    spin = number(f"{place}.angular_velocity", body.angular_velocity)
    number(f"{place}.angle", body.angle)
    if body.type == "static" and (spin or any(velocity)):
        raise SceneError(f"{place}.velocity: a static body does not move; use 0, or a kinematic one")
    for key in ("mass", "inertia", "density"):
        if getattr(body, key) is not None and not (key == "inertia" and body.inertia == math.inf):
            number(f"{place}.{key}", getattr(body, key), 0, above=True)
    number(f"{place}.friction", body.friction, 0)
    number(f"{place}.restitution", body.restitution, 0, high=1)
    number(f"{place}.gravity_scale", body.gravity_scale)
    number(f"{place}.linear_damping", body.linear_damping, 0)
    number(f"{place}.angular_damping", body.angular_damping, 0)
    _check_forces(f"{place}.forces", body.forces)
    body.mass_and_inertia(place)


def _check_forces(place, forces):
    """[torque, fx, fy], or rows [t, torque, fx, fy] with increasing times; [] for none."""
    if len(forces) == 0:
        return
    if not hasattr(forces[0], "__len__"):
        numbers(place, forces, 3)
        return
    before = -math.inf
    for k, row in enumerate(forces):
        time = numbers(f"{place}[{k}]", row, 4)[0]
        if time <= before:
            raise SceneError(f"{place}[{k}][0]: times must increase, {time:g} follows {before:g}")
        before = time


def check_joint(place, joint, bodies):
    """Two bodies that are there, one of them dynamic."""
    for key in ("body_a", "body_b"):
        index = getattr(joint, key)
        if not 0 <= index < len(bodies):
            raise SceneError(f"{place}.{key}: there is no body {index}")
    numbers(f"{place}.anchor", joint.anchor, 2)
    if joint.body_a == joint.body_b:
        raise SceneError(f"{place}.body_b: joins the body to itself; name another body")
    if "dynamic" not in (bodies[joint.body_a].type, bodies[joint.body_b].type):
        raise SceneError(f"{place}: neither body is dynamic; one of them must be")
    _check_joint_fields(place, joint)


def _check_joint_fields(place, joint):
    if joint.type not in JOINT_KEYS:
        raise SceneError(f"{place}.type: must be one of {', '.join(JOINT_KEYS)}, is {joint.type!r}")
    has = JOINT_KEYS[joint.type]
    for key in dict.fromkeys(k for keys in JOINT_KEYS.values() for k in keys):
        if key not in has and getattr(joint, key) != _PLAIN.get(key, 0):
            raise SceneError(f"{place}.{key}: a {joint.type} joint has none")
    for key in ("anchor_b", "axis"):
        if key in has:
            if getattr(joint, key) is None:
                raise SceneError(f"{place}.{key}: must be given")
            setattr(joint, key, numbers(f"{place}.{key}", getattr(joint, key), 2))
    if "axis" in has and not any(joint.axis):
        raise SceneError(f"{place}.axis: is no direction")
    if not joint.lower < joint.upper:
        raise SceneError(f"{place}.lower: must be below upper, {joint.upper:g}")
    number(f"{place}.restitution", joint.restitution, 0, high=1)
    for key in ("stiffness", "damping", "motor_limit"):
        number(f"{place}.{key}", getattr(joint, key), 0)
    for key in ("rest", "motor_speed"):
        number(f"{place}.{key}", getattr(joint, key))
    if joint.type == "target" and not joint.stiffness > 0:
        raise SceneError(f"{place}.stiffness: must be given: how hard the target pulls [N/m]")
    for key in ("break_force", "break_torque"):
        if not getattr(joint, key) > 0:
            raise SceneError(f"{place}.{key}: must be > 0; math.inf: never")
