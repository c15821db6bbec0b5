"""What a client can ask for.  `Client` waits for each answer, `AsyncClient` hands out awaitables."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .errors import CaromError, SessionLost
from .exchange import Exchange, Protocol, check, session_request
from .messages import loss_gradient_t, parameter_gradient_t, scene_t, step_request_t
from .results import NO_PARAMETER, WRT, gradient_of, parameters_of, state_of
from .scene import Scene


def scene_message(scene):
    """The scene_t of a Scene; mass and inertia as they are stored or follow from the shapes."""
    m = scene_t()
    mass, inertia = scene.masses()
    m.scene_name = scene.name
    m.gravity = list(scene.gravity)
    settings = {**{name: _setting(x) for name, x in scene.settings.items()}, "dt": repr(scene.dt)}
    m.setting_name, m.setting_value = list(settings), list(settings.values())
    m.num_settings = len(settings)
    _fill_bodies(m, scene, mass, inertia)
    _fill_shapes(m, scene)
    _fill_joints(m, scene.joints)
    return m


# Numbers of a joint: in scene_t, and in Joint.
_JOINT_NUMBERS = {"joint_lower": "lower", "joint_upper": "upper", "joint_restitution": "restitution",
                  "joint_damping": "damping",
                  **{key: key for key in ("stiffness", "rest", "motor_speed", "motor_limit",
                                          "break_force", "break_torque")}}


def _fill_joints(m, joints):
    m.num_joints = len(joints)
    m.joint_type = [getattr(scene_t, j.type.upper()) for j in joints]
    m.joint_body_a = [j.body_a for j in joints]
    m.joint_body_b = [j.body_b for j in joints]
    m.joint_collide = [int(j.collides()) for j in joints]
    m.anchor = [float(x) for j in joints for x in j.anchor]
    m.anchor_b = [float(x) for j in joints for x in j.anchor_b or j.anchor]
    m.axis = [float(x) for j in joints for x in j.axis or (1, 0)]
    m.num_anchor_coords = len(m.anchor)
    for key, name in _JOINT_NUMBERS.items():
        setattr(m, key, [float(getattr(j, name)) for j in joints])


def _setting(value):
    if isinstance(value, bool):
        return str(int(value))
    return value if isinstance(value, str) else repr(value)


def _fill_bodies(m, scene, mass, inertia):
    types = {"dynamic": scene_t.DYNAMIC, "static": scene_t.STATIC, "kinematic": scene_t.KINEMATIC}
    bodies = scene.bodies
    m.num_bodies = len(bodies)
    m.body_name = [b.name for b in bodies]
    m.body_type = [types[b.type] for b in bodies]
    m.collide = [int(b.collide) for b in bodies]
    m.mass, m.inertia = mass.tolist(), inertia.tolist()
    m.friction = [float(b.friction) for b in bodies]
    m.restitution = [float(b.restitution) for b in bodies]
    m.gravity_scale = [float(b.gravity_scale) for b in bodies]
    m.linear_damping = [float(b.linear_damping) for b in bodies]
    m.angular_damping = [float(b.angular_damping) for b in bodies]
    m.sensor = [int(b.sensor) for b in bodies]
    m.filter_category = [_signed(b.filter.get("category", 1)) for b in bodies]
    m.filter_mask = [_signed(b.filter.get("mask", 0xFFFFFFFF)) for b in bodies]
    m.filter_group = [int(b.filter.get("group", 0)) for b in bodies]
    m.num_coords = 3 * len(bodies)
    m.q = scene.q().ravel().tolist()
    m.v = scene.v().ravel().tolist()
    m.force = [float(f) for b in bodies for f in b.forces_constant()]


def _signed(bits):
    """32 bits as the int32 that LCM has."""
    return bits - (1 << 32) if bits >= 1 << 31 else int(bits)


def _fill_shapes(m, scene):
    pairs = [(b.index, shape) for b in scene.bodies for shape in b.shapes]
    m.num_shapes = len(pairs)
    m.shape_body = [index for index, _ in pairs]
    m.shape_num_vertices = [len(shape.vertices) for _, shape in pairs]
    m.radius = [shape.radius for _, shape in pairs]
    m.vertices = [x for _, shape in pairs for vertex in shape.vertices for x in vertex]
    m.num_vertex_coords = len(m.vertices)


class PublishedSteps(Sequence):
    """Steps of the states that a request publishes: every n-th and the last.  No list: requests that
    a server will refuse may ask for any number."""

    def __init__(self, start, count, every):
        self._every = range(start + every, start + count + 1, every) if every > 0 else range(0)
        self._last = start + count
        self._extra = not self._every or self._every[-1] != self._last

    def __len__(self):
        return len(self._every) + self._extra

    def __getitem__(self, k):
        if self._extra and k in (-1, len(self._every)):
            return self._last
        return self._every[k]


class Calls:
    """The requests; `_run(exchange, finish)` of a subclass sees them through."""

    protocol: Protocol
    scene = None  # as it was opened
    parameters = None  # Parameters, after the first descent
    seconds = 0.0  # the server spent on the last request that was answered

    def _run(self, exchange, finish):
        raise NotImplementedError

    def _request(self, exchange, finish=lambda exchange: None, numbered=True):
        if self.scene is None:
            raise SessionLost("no session is open: open a scene first")

        def end(done):
            check(done)
            self.seconds = done.reply.seconds
            return finish(done)

        return self._run(self.protocol.start(exchange, numbered), end)

    # --- scenes and steps

    def open(self, scene):
        """Opens a session with the scene (a Scene, or what Scene.from_json reads), or replaces the
        scene of the session: step 0 again."""
        if not isinstance(scene, Scene):
            scene = Scene.from_json(scene)
        if self.protocol.lost:
            self.protocol.renew_session()
        message = scene_message(scene)
        self.scene = scene
        self.protocol.planned_step = 0
        return self._request(self.protocol.scene(message))

    def step(self, count, every=1, record=False, forces=None, contacts=False, on_state=None):
        """Advances by `count` steps; list of the States published: every n-th and the last.

        every: 0 publishes the last only.  record: True continues the tape for gradients (or starts
        it here), "restart" starts a new one, False forgets it.  forces: (count, n, 3), added to the
        constant forces; force tables of the scene are added by themselves.  on_state: called with
        each State as soon as it is there, in order."""
        start = self.protocol.planned_step
        message = step_request_t()
        message.from_step = start
        message.num_steps = int(count)
        message.publish_every = int(every)
        message.want = step_request_t.WANT_Q | step_request_t.WANT_V
        message.want |= step_request_t.WANT_CONTACTS if contacts else 0
        message.record = {False: step_request_t.RECORD_OFF, True: step_request_t.RECORD_ON,
                          "restart": step_request_t.RECORD_RESTART}[record]
        self._fill_forces(message, start, forces)
        steps = PublishedSteps(start, message.num_steps, message.publish_every)
        callback = (lambda m: on_state(state_of(m))) if on_state else None
        exchange = Exchange("CAROM_STEP", message, steps, on_state=callback)
        self.protocol.planned_step = start + message.num_steps
        return self._request(exchange, lambda e: [state_of(e.states[s]) for s in steps])

    def state(self, contacts=False):
        """The present State, without a step; the tape is kept when there is one."""
        message = step_request_t()
        message.from_step = self.protocol.planned_step
        message.want = step_request_t.WANT_Q | step_request_t.WANT_V
        message.want |= step_request_t.WANT_CONTACTS if contacts else 0
        message.record = step_request_t.RECORD_ON
        exchange = Exchange("CAROM_STEP", message, [message.from_step])
        return self._request(exchange, lambda e: state_of(e.states[message.from_step]))

    def _fill_forces(self, message, start, forces):
        bodies = self.scene.bodies if self.scene else []
        tabled = any(b.forces_table() for b in bodies)
        if forces is None and not tabled:
            return
        total = np.zeros((message.num_steps, len(bodies), 3))
        if forces is not None:
            total += np.asarray(forces, float)
        for k in range(message.num_steps if tabled else 0):
            total[k] += self.scene.forces_of_step(start + k)
        steps, bodies = np.nonzero(total.any(axis=2))
        message.num_forces = len(steps)
        message.force_step, message.force_body = steps.tolist(), bodies.tolist()
        message.step_force = total[steps, bodies].ravel().tolist()
        message.num_force_values = len(message.step_force)

    # --- gradients

    def gradient(self, cotangents, wrt=("q0", "v0", "mass", "inertia"), cost=math.nan):
        """Gradient of the loss whose derivative with respect to the recorded states is `cotangents`:
        {step: (q_bar, v_bar)}, each (n, 3) or None.  cost comes back in the Gradient."""
        n = len(self.scene.bodies) if self.scene else 0
        message = loss_gradient_t()
        message.cost = float(cost)
        for name in (wrt,) if isinstance(wrt, str) else wrt:
            if name not in WRT:
                raise CaromError(f"{name}: not one of {', '.join(WRT)}")
            message.wanted |= WRT[name]
        steps = sorted(cotangents)
        message.num_bars = len(steps)
        message.bar_step = [int(s) for s in steps]
        message.q_bar = _flat(n, [cotangents[s][0] for s in steps])
        message.v_bar = _flat(n, [cotangents[s][1] for s in steps])
        message.num_bar_coords = len(message.q_bar)
        exchange = Exchange("CAROM_LOSS_GRADIENT", message, needs="CAROM_PARAMETER_GRADIENT")
        return self._request(
            exchange, lambda e: gradient_of(e.answer, n, e.reply.seconds))

    def descend(self, gradient, rate, wrt=None, keep_state=False):
        """The server sets parameter - rate * gradient, within the valid range; the new Parameters.

        Then the session is at step 0 again, or, with keep_state, goes on from its present state."""
        message = parameter_gradient_t()
        if wrt is None:
            wrt = [name for name in gradient.wanted() if name not in NO_PARAMETER]
        for name in (wrt,) if isinstance(wrt, str) else wrt:
            values = np.ravel(getattr(gradient, name)).tolist()
            message.wanted |= WRT[name]
            setattr(message, name, values)
            setattr(message, f"num_{name}", len(values))
        message.rate = float(rate)
        message.keep_state = int(keep_state)
        if not keep_state:
            self.protocol.planned_step = 0

        def finish(exchange):
            self.parameters = parameters_of(exchange.answer)
            return self.parameters

        return self._request(
            Exchange("CAROM_DESCEND", message, needs="CAROM_SCENE_UPDATED"), finish)

    # --- sessions

    def snapshot(self, number=1):
        """Keeps the present state under a number >= 1."""
        self.protocol.snapshots[number] = self.protocol.planned_step
        return self._session("SNAPSHOT", number)

    def restore(self, number=1):
        """Goes back to a snapshot; the tape is forgotten."""
        if number in self.protocol.snapshots:
            self.protocol.planned_step = self.protocol.snapshots[number]
        return self._session("RESTORE", number)

    def reset(self):
        """Step 0 of the present scene."""
        self.protocol.planned_step = 0
        return self._session("RESET")

    def keep_alive(self):
        """Renews the lease of the session (30 s after the last sign of life)."""
        exchange = Exchange("CAROM_SESSION", session_request("KEEP_ALIVE"))
        return self._request(exchange, numbered=False)

    def close_session(self):
        """The server forgets the session."""
        self.protocol.lost = True
        return self._session("CLOSE")

    def _session(self, action, number=0):
        return self._request(Exchange("CAROM_SESSION", session_request(action, number)))


def _flat(n, arrays):
    """Arrays of (n, 3) after each other; None is zero."""
    out = []
    for x in arrays:
        out += [0.0] * (3 * n) if x is None else np.asarray(x, float).reshape(n, 3).ravel().tolist()
    return out

