"""Scenes: built by hand or read from a carom-scene/1 file, written back, or sent to a server."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import shapes as _shapes
from .checks import COLLIDING, JOINT_KEYS, check_body, check_joint, number, numbers
from .errors import SceneError
from .shapes import Shape

FORMAT = "carom-scene/1"
CENTROID_TOL = 1e-6  # of the extent: how far a centroid may be from the position


@dataclass(eq=False)
class Body:
    """A body as the scene file has it.  `index` is its place in the arrays of states."""

    shapes: list[Shape] = field(default_factory=list)
    type: str = "dynamic"
    position: tuple[float, float] = (0.0, 0.0)  # center of mass [m]
    angle: float = 0.0  # [rad]
    velocity: tuple[float, float] = (0.0, 0.0)  # [m/s]
    angular_velocity: float = 0.0  # [rad/s]
    mass: float | None = None  # [kg]
    inertia: float | None = None  # about the position [kg m^2]; math.inf: no rotation
    density: float | None = None  # [kg/m^2]; mass and inertia then follow
    friction: float = 0.5
    restitution: float = 0.0
    collide: bool = True
    gravity_scale: float = 1.0  # times the scene's gravity
    linear_damping: float = 0.0  # d in the force -d m v [1/s]
    angular_damping: float = 0.0  # d in the torque -d I omega [1/s]
    sensor: bool = False  # touches nothing
    filter: dict = field(default_factory=dict)  # category, mask, group
    forces: list = field(default_factory=list)  # [torque, fx, fy] or rows [t, torque, fx, fy]
    name: str = ""
    index: int = -1

    def __index__(self):
        return self.index

    def gyration(self):
        """Squared radius of gyration of the shapes about the position [m^2]; 0 without an area."""
        if len(self.shapes) == 1 and self.shapes[0].kind == "segment":
            a, b = np.array(self.shapes[0].vertices)
            return float(a @ a + a @ b + b @ b) / 3
        area, _, second = self.moments()
        return second / area if area > 0 else 0.0

    def moments(self):
        """Area, first and second moment of all shapes about the position."""
        parts = [shape.moments() for shape in self.shapes]
        first = sum((p[1] for p in parts), np.zeros(2))
        return sum(p[0] for p in parts), first, sum(p[2] for p in parts)

    def mass_and_inertia(self, place="body"):
        """The two numbers that the engine is given: as stored, or as they follow from the shapes."""
        if self.type != "dynamic":
            return self.mass or 1.0, self.inertia or 1.0
        if self.density is not None:
            return self._from_density(place)
        if self.mass is None:
            raise SceneError(f"{place}.mass: a dynamic body needs a mass [kg], or a density [kg/m^2]")
        if self.inertia is not None:
            return self.mass, self.inertia
        if not self.gyration() > 0:
            raise SceneError(f"{place}.inertia: must be given: the body has no shape to follow from")
        return self.mass, self.mass * self.gyration()

    def _from_density(self, place):
        if self.mass is not None or self.inertia is not None:
            raise SceneError(f"{place}.density: mass and inertia follow from it; give either")
        area, first, second = self.moments()
        if not area > 0:
            raise SceneError(f"{place}.density: the body has no area; give mass and inertia")
        extent = max(math.hypot(*v) + s.radius for s in self.shapes for v in s.vertices)
        x, y = first / area
        if math.hypot(x, y) > CENTROID_TOL * extent:
            raise SceneError(f"{place}.density: the centroid of the shape is at ({x:.17g}, {y:.17g}), "
                             "not at the position (0, 0)")
        return self.density * area, self.density * second

    def forces_constant(self):
        """(torque, fx, fy), zero when the forces are a table over time."""
        return [0.0, 0.0, 0.0] if self.forces_table() or not self.forces else list(self.forces)

    def forces_table(self):
        """Rows [t, torque, fx, fy]; empty when the forces are constant."""
        return self.forces if self.forces and np.ndim(self.forces[0]) == 1 else []


@dataclass
class Joint:
    body_a: int
    body_b: int
    anchor: tuple[float, float]  # world point at the initial poses [m]
    type: str = "revolute"  # prismatic, weld, wheel, distance, rope, target, lock_x, lock_y, lock_angle
    name: str = ""
    anchor_b: tuple[float, float] | None = None  # distance, rope: the point of body B [m]
    axis: tuple[float, float] | None = None  # prismatic, wheel: direction of the line
    collide: bool | None = None  # None: as is usual for the type
    lower: float = -math.inf  # limits [rad, m]
    upper: float = math.inf
    restitution: float = 0.0  # at them
    stiffness: float = 0.0  # of a spring [N/m, N m/rad]
    damping: float = 0.0  # [N s/m, N m s/rad]
    rest: float = 0.0  # where it gives no force [rad, m]
    motor_speed: float = 0.0  # [rad/s, m/s]
    motor_limit: float = 0.0  # largest torque or force [N m, N]; 0: no motor
    break_force: float = math.inf  # breaks beyond [N]
    break_torque: float = math.inf  # [N m]

    def collides(self):
        """Whether the two bodies may touch each other."""
        return self.type in COLLIDING if self.collide is None else bool(self.collide)


_BODY_KEYS = {"name", "type", "position", "angle", "velocity", "angular_velocity", "mass", "inertia",
              "density", "friction", "restitution", "collide", "filter", "forces"}
_SCENE_KEYS = {"format", "name", "gravity", "dt", "duration", "sample", "settings", "bodies", "joints"}
# What the engine knows of a body or joint and a scene file does not.
_NOT_IN_FILES = {"gravity_scale", "linear_damping", "angular_damping", "sensor", "break_force",
                 "break_torque"}


def _check_keys(place, data, known):
    if not isinstance(data, dict):
        raise SceneError(f"{place or 'the file'}: must be an object")
    for key in data:
        if key not in known and key != "reference" and not key.startswith("_"):
            raise SceneError(f"{place}{'.' if place else ''}{key}: unknown key")


class Scene:
    def __init__(self, name="", gravity=(0.0, -9.81), dt=1 / 60, duration=None, sample=None,
                 settings=None):
        self.name = name
        self.gravity = numbers("gravity", gravity, 2)
        self.dt = number("dt", dt, 0, above=True)
        self.duration = None if duration is None else number("duration", duration, 0)
        self.sample = None if sample is None else number("sample", sample, 0, above=True)
        self.settings = dict(settings or {})
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []

    # --- building

    def add(self, body):
        """Adds a Body, gives it its index and returns it."""
        check_body(f"bodies[{len(self.bodies)}]", body)
        body.index = len(self.bodies)
        self.bodies.append(body)
        return body

    def dynamic(self, shape=None, **fields):
        """A body that moves: give mass, mass and inertia, or density."""
        return self.add(Body(_shape_list(shape), "dynamic", **fields))

    def static(self, shape=None, **fields):
        """A body that never moves."""
        return self.add(Body(_shape_list(shape), "static", **fields))

    def kinematic(self, shape=None, **fields):
        """A body that moves with its given velocity whatever touches it."""
        return self.add(Body(_shape_list(shape), "kinematic", **fields))

    def pin(self, body_a, body_b, anchor, name=""):
        """Revolute joint at a world point; joined bodies do not collide."""
        return self.join("revolute", body_a, body_b, anchor, name=name)

    def join(self, type, body_a, body_b, anchor, **fields):
        """Joint of any type at a world point, with fields of Joint by name: docs/joint.md."""
        place = f"joints[{len(self.joints)}]"
        joint = Joint(body_a.__index__(), body_b.__index__(), numbers(f"{place}.anchor", anchor, 2),
                      type, **fields)
        return self._add_joint(place, joint)

    def _add_joint(self, place, joint):
        check_joint(place, joint, self.bodies)
        self.joints.append(joint)
        return joint

    # --- what the engine sees

    def q(self):
        """(n, 3): angle, x, y."""
        return np.array([[b.angle, *b.position] for b in self.bodies], float).reshape(-1, 3)

    def v(self):
        """(n, 3): omega, vx, vy."""
        return np.array([[b.angular_velocity, *b.velocity] for b in self.bodies], float).reshape(-1, 3)

    def masses(self):
        """(n,) and (n,): mass and inertia of each body."""
        pairs = [b.mass_and_inertia(f"bodies[{i}]") for i, b in enumerate(self.bodies)]
        return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])

    def forces_of_step(self, step):
        """(n, 3): mean of the force tables over the step that starts at step * dt; None without any.

        The mean keeps impulses exact where a row starts within a step."""
        if not any(b.forces_table() for b in self.bodies):
            return None
        out = np.zeros((len(self.bodies), 3))
        start, end = step * self.dt, (step + 1) * self.dt
        for i, body in enumerate(self.bodies):
            rows = body.forces_table()
            for k, row in enumerate(rows):
                until = rows[k + 1][0] if k + 1 < len(rows) else math.inf
                share = min(end, until) - max(start, row[0])
                if share > 0:
                    out[i] += np.array(row[1:], float) * share / (end - start)
        return out

    # --- files

    @classmethod
    def from_json(cls, source):
        """Scene of a file name, or of the data of one (dict)."""
        if not isinstance(source, dict):
            source = _load_file(source)
        _check_keys("", source, _SCENE_KEYS)
        for key in ("bodies", "joints"):
            if not isinstance(source.get(key, []), (list, tuple)):
                raise SceneError(f"{key}: must be an array [...]")
        if not isinstance(source.get("settings", {}), dict):
            raise SceneError("settings: must be an object {name: value, ...}")
        if source.get("format") != FORMAT:
            raise SceneError(f"format: must be {FORMAT!r}, is {source.get('format')!r}")
        settings = dict(source.get("settings", {}))
        dt = source.get("dt", settings.pop("dt", 1 / 60))
        scene = cls(source.get("name", ""), source.get("gravity", (0.0, -9.81)), dt,
                    source.get("duration"), source.get("sample"), settings)
        for i, data in enumerate(source.get("bodies", ())):
            scene.add(_body_from_json(f"bodies[{i}]", data))
        for k, data in enumerate(source.get("joints", ())):
            scene._add_joint(f"joints[{k}]", scene._joint_from_json(f"joints[{k}]", data))
        return scene

    def to_json(self):
        """The data of a carom-scene/1 file, as a dict."""
        out = {"format": FORMAT, "name": self.name, "gravity": list(self.gravity), "dt": self.dt}
        out.update({k: getattr(self, k) for k in ("duration", "sample") if getattr(self, k) is not None})
        if self.settings:
            out["settings"] = dict(self.settings)
        out["bodies"] = [_body_to_json(body) for body in self.bodies]
        out["joints"] = [_joint_to_json(k, joint) for k, joint in enumerate(self.joints)]
        return out

    def save(self, path):
        Path(path).write_text(json.dumps(self.to_json()) + "\n", encoding="ascii")

    def _joint_from_json(self, place, data):
        kind = data.get("type") if isinstance(data, dict) else None
        if isinstance(data, dict) and kind not in JOINT_KEYS:
            raise SceneError(f"{place}.type: must be one of {', '.join(JOINT_KEYS)}, is {kind!r}")
        fields = JOINT_KEYS.get(kind, ())
        _check_keys(place, data, {"type", "body_a", "body_b", "anchor", "name", "collide", *fields})
        for key in ("body_a", "body_b", "anchor"):
            if key not in data:
                raise SceneError(f"{place}.{key}: must be given")
        a = self._find(f"{place}.body_a", data["body_a"])
        b = self._find(f"{place}.body_b", data["body_b"])
        return Joint(a, b, numbers(f"{place}.anchor", data["anchor"], 2), kind,
                     **{key: data[key] for key in ("name", "collide", *fields) if key in data})

    def _find(self, place, reference):
        """Index of a body given by index or name."""
        if isinstance(reference, str):
            found = [b.index for b in self.bodies if b.name == reference]
            if len(found) != 1:
                raise SceneError(f"{place}: {len(found)} bodies are named {reference!r}")
            return found[0]
        if not isinstance(reference, int) or not 0 <= reference < len(self.bodies):
            raise SceneError(f"{place}: there is no body {reference}")
        return int(reference)


def _load_file(path):
    def pairs(items):
        keys = [key for key, _ in items]
        for key in keys:
            if keys.count(key) > 1:
                raise SceneError(f"{path}: {key}: the key stands twice; keep one of them")
        return dict(items)

    try:
        return json.loads(Path(path).read_text(encoding="utf-8"), object_pairs_hook=pairs)
    except json.JSONDecodeError as error:
        raise SceneError(f"{path}: line {error.lineno}, column {error.colno}: {error.msg}") from None
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: byte {error.start}: not UTF-8") from None


def _shape_list(shape):
    if shape is None:
        return []
    return [shape] if isinstance(shape, Shape) else list(shape)


def _body_from_json(place, data):
    _check_keys(place, data, _BODY_KEYS | {"shape", "shapes"})
    if "shape" in data and "shapes" in data:
        raise SceneError(f"{place}.shapes: stands beside shape; keep one of them")
    shapes = [_shapes.from_json(f"{place}.shape", data["shape"])] if "shape" in data else [
        _shapes.from_json(f"{place}.shapes[{k}]", s) for k, s in enumerate(data.get("shapes", ()))]
    return Body(shapes, **{key: data[key] for key in _BODY_KEYS if key in data})


def _only_in_engine(place, item, plain):
    for key in sorted(_NOT_IN_FILES):
        if getattr(item, key, None) != getattr(plain, key, None):
            raise SceneError(f"{place}.{key}: {FORMAT} has no such key; only a server takes it")


def _body_to_json(body):
    out = {}
    plain = Body()
    _only_in_engine(f"bodies[{body.index}]", body, plain)
    if body.inertia == math.inf:
        raise SceneError(f"bodies[{body.index}].inertia: {FORMAT} has no infinite numbers; only a "
                         "server takes it")
    for key in sorted(_BODY_KEYS):
        value = getattr(body, key)
        if value != getattr(plain, key):
            out[key] = list(value) if isinstance(value, tuple) else value
    if len(body.shapes) == 1:
        out["shape"] = body.shapes[0].to_json()
    elif body.shapes:
        out["shapes"] = [shape.to_json() for shape in body.shapes]
    return out


def _joint_to_json(k, joint):
    out = {"type": joint.type, "body_a": joint.body_a, "body_b": joint.body_b,
           "anchor": list(joint.anchor)}
    plain = Joint(0, 0, (0.0, 0.0))
    _only_in_engine(f"joints[{k}]", joint, plain)
    for key in ("name", "collide", *JOINT_KEYS[joint.type]):
        value = getattr(joint, key)
        if value != getattr(plain, key):
            out[key] = list(value) if isinstance(value, tuple) else value
    return out
