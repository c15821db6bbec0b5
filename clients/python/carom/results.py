"""What the server answers, as numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

# Bits of parameter_gradient_t.wanted, in the order of its arrays.
WRT = {"q0": 1, "v0": 2, "mass": 4, "inertia": 8, "friction": 16, "restitution": 32, "gravity": 64,
       "force": 128, "force_steps": 256, "radius": 512, "vertices": 1024, "anchors": 2048,
       "dt": 4096, "gravity_scale": 8192, "linear_damping": 16384, "angular_damping": 32768,
       "axes": 65536, "angles": 131072, "lengths": 262144, "lower": 524288, "upper": 1048576,
       "stiffness": 2097152, "damping": 4194304, "rest": 8388608, "motor_speed": 16777216,
       "motor_limit": 33554432}

# What has a gradient but is no parameter of a session: a descent leaves it alone.
NO_PARAMETER = ("force_steps", "dt", "angles", "lengths")

# Shape of each array behind its first axis.
_TAIL = {"q0": (3,), "v0": (3,), "force": (3,), "vertices": (2,), "anchors": (2, 2)}


@dataclass
class State:
    """State after `step` steps; the figures are those of the step that led here."""

    step: int
    time: float  # [s]
    q: np.ndarray  # (n, 3): angle, x, y
    v: np.ndarray  # (n, 3): omega, vx, vy
    status: int = 0  # 0 done, > 0 usable with a caveat
    residual: float = 0.0
    penetration: float = 0.0  # [m]
    joint_drift: float = 0.0  # [m]
    energy: float = 0.0  # [J]
    substeps: int = 0
    events: int = 0
    iterations: int = 0
    factorizations: int = 0
    degenerate: int = 0
    contacts: list = field(default_factory=list)


@dataclass
class Contact:
    body_a: int
    body_b: int
    point: np.ndarray  # on body A, world [m]
    normal: np.ndarray  # from A to B
    gap: float  # [m]
    impulse: tuple  # along normal and tangent [N s]
    mode: int  # 0 open, 1 stick, 2 and 3 slip


_FIGURES = ("status", "residual", "penetration", "joint_drift", "energy", "substeps", "events",
            "iterations", "factorizations", "degenerate")


def state_of(message):
    """State of a state_t."""
    points = np.array(message.contact_point, float).reshape(-1, 2)
    normals = np.array(message.contact_normal, float).reshape(-1, 2)
    contacts = [
        Contact(message.contact_body_a[k], message.contact_body_b[k], points[k], normals[k],
                message.contact_gap[k], (message.impulse_normal[k], message.impulse_tangent[k]),
                message.contact_mode[k])
        for k in range(message.num_contacts)]
    return State(message.step, message.sim_time, np.array(message.q, float).reshape(-1, 3),
                 np.array(message.v, float).reshape(-1, 3),
                 **{name: getattr(message, name) for name in _FIGURES}, contacts=contacts)


@dataclass
class Gradient:
    """Gradient of a loss; arrays that were not asked for are None.

    Mass and inertia are partial derivatives of the stored numbers.  Radii come per shape, vertices
    per vertex in the body frame, anchors per joint: in the frame of body A, then of body B."""

    cost: float
    first_step: int  # at which the tape starts: q0 and v0 belong to it
    recorded_steps: int
    degenerate: int  # contacts at a kink: a one-sided element was taken
    seconds: float  # the server spent
    q0: np.ndarray | None = None  # (n, 3)
    v0: np.ndarray | None = None  # (n, 3)
    mass: np.ndarray | None = None  # (n,)
    inertia: np.ndarray | None = None  # (n,)
    friction: np.ndarray | None = None  # (n,)
    restitution: np.ndarray | None = None  # (n,)
    gravity: np.ndarray | None = None  # (2,)
    force: np.ndarray | None = None  # (n, 3): constant force through all steps
    force_steps: np.ndarray | None = None  # (steps, n, 3)
    radius: np.ndarray | None = None  # (shapes,)
    vertices: np.ndarray | None = None  # (vertices, 2)
    anchors: np.ndarray | None = None  # (joints, 2, 2)
    dt: np.ndarray | None = None  # (1,): length of a step
    gravity_scale: np.ndarray | None = None  # (n,)
    linear_damping: np.ndarray | None = None  # (n,)
    angular_damping: np.ndarray | None = None  # (n,)
    axes: np.ndarray | None = None  # (joints,), like all below: angle of the line in body A
    angles: np.ndarray | None = None  # held turns
    lengths: np.ndarray | None = None  # held distances
    lower: np.ndarray | None = None
    upper: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    damping: np.ndarray | None = None
    rest: np.ndarray | None = None
    motor_speed: np.ndarray | None = None
    motor_limit: np.ndarray | None = None
    message: object = None  # the parameter_gradient_t itself

    def wanted(self):
        return [name for name in WRT if getattr(self, name) is not None]


def gradient_of(message, n_bodies, seconds):
    """Gradient of a parameter_gradient_t."""
    out = Gradient(message.cost, message.first_step, message.recorded_steps, message.degenerate,
                   seconds, message=message)
    for name, bit in WRT.items():
        if message.wanted & bit:
            x = np.array(getattr(message, name), float)
            tail = (n_bodies, 3) if name == "force_steps" else _TAIL.get(name, ())
            setattr(out, name, x.reshape((-1, *tail)))
    return out


@dataclass
class Parameters:
    """Parameters of a session as the server holds them."""

    q: np.ndarray  # (n, 3)
    v: np.ndarray  # (n, 3)
    mass: np.ndarray
    inertia: np.ndarray
    friction: np.ndarray
    restitution: np.ndarray
    gravity: np.ndarray
    force: np.ndarray  # (n, 3)
    radius: np.ndarray
    vertices: np.ndarray  # (vertices, 2)
    anchors: np.ndarray  # (joints, 2): world points at the poses q
    anchors_b: np.ndarray  # (joints, 2)
    axes: np.ndarray  # (joints, 2): directions at the poses q
    gravity_scale: np.ndarray
    linear_damping: np.ndarray
    angular_damping: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    rest: np.ndarray
    motor_speed: np.ndarray
    motor_limit: np.ndarray


# In a scene_t, in the order of Parameters.
_NUMBERS = ("gravity_scale", "linear_damping", "angular_damping", "joint_lower", "joint_upper",
            "stiffness", "joint_damping", "rest", "motor_speed", "motor_limit")


def parameters_of(message):
    """Parameters of a scene_t."""
    def rows(x, k):
        return np.array(x, float).reshape(-1, k)

    return Parameters(rows(message.q, 3), rows(message.v, 3), np.array(message.mass),
                      np.array(message.inertia), np.array(message.friction),
                      np.array(message.restitution), np.array(message.gravity),
                      rows(message.force, 3), np.array(message.radius), rows(message.vertices, 2),
                      rows(message.anchor, 2), rows(message.anchor_b, 2), rows(message.axis, 2),
                      *(np.array(getattr(message, name)) for name in _NUMBERS))
