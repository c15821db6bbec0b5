"""The clients over a real caromd: the same numbers as the command line, and clear errors."""

import asyncio
import json
import math
import os
import signal
import tempfile
import threading
import unittest
from pathlib import Path

import numpy as np
from carom import (
    AsyncClient,
    CaromError,
    Client,
    ComputationFailed,
    NoServer,
    Refused,
    Scene,
    Server,
    SessionLost,
    Trajectory,
    box,
    circle,
)
from support import CAROMD, SCENES, carom, needs_carom, needs_caromd


def free_body():
    """No gravity, no contact: closed forms."""
    scene = Scene("free", gravity=(0, 0), dt=0.25, settings={"integrator": "euler"})
    scene.dynamic(circle(1), mass=2, inertia=1, velocity=(3, 0), forces=[0, 5, 0])
    return scene


class WithServer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.server = Server(CAROMD)

    @classmethod
    def tearDownClass(cls):
        code = cls.server.stop()
        assert code == 0, f"caromd ended with {code}"


@needs_caromd
class Blocking(WithServer):
    def setUp(self):
        self.client = Client(self.server.url)
        self.addCleanup(self.client.close)

    def test_free_body(self):
        # x_n = x_0 + n h v_0 + (F/m) h^2 n (n + 1)/2, four roundings near 5
        self.client.open(free_body())
        states = self.client.step(4)
        self.assertEqual([s.step for s in states], [1, 2, 3, 4])
        for n, state in enumerate(states, 1):
            self.assertAlmostEqual(state.q[0, 1], 0.75 * n + 2.5 * 0.0625 * n * (n + 1) / 2, delta=1e-14)
            self.assertEqual(state.time, 0.25 * n)

    def test_damped_locked_and_sensing_bodies(self):
        scene = Scene(gravity=(0, -10), dt=1 / 60)
        damped = scene.dynamic(circle(0.1), mass=1, velocity=(3, 0), linear_damping=2, gravity_scale=0)
        locked = scene.dynamic(circle(0.1), position=(5, 0), mass=1, inertia=math.inf,
                               forces=[7, 0, 0], gravity_scale=0.5)
        scene.static(box(9, 1), position=(5, -1), sensor=True)
        self.client.open(scene)
        state = self.client.step(60, every=0, record=True)[-1]
        self.assertAlmostEqual(state.v[damped, 1], 3 * math.exp(-2), delta=1e-14)
        self.assertEqual(state.q[locked, 0], 0)
        self.assertAlmostEqual(state.q[locked, 2], -2.5, delta=1e-13)  # through the sensor
        bar = np.zeros((3, 3))
        bar[damped, 1] = 1
        g = self.client.gradient({60: (None, bar)}, wrt=("linear_damping", "gravity_scale"))
        self.assertAlmostEqual(g.linear_damping[damped], -3 * math.exp(-2), delta=1e-13)
        self.assertEqual(self.client.descend(g, 0.1, wrt=("linear_damping",)).linear_damping[damped],
                         2 - 0.1 * g.linear_damping[damped])

    def test_parameters_of_joints(self):
        # m x'' = -k x from 1: d x / dk = -t sin(w t) / (2 m w), but for h^2
        scene = Scene(gravity=(0, 0), dt=1 / 2000)
        rail = scene.static()
        cart = scene.dynamic(position=(1, 0), mass=2, inertia=1)
        scene.join("prismatic", rail, cart, (1, 0), axis=(1, 0), stiffness=18, rest=-1)
        self.client.open(scene)
        self.client.step(2000, every=0, record=True)
        bar = np.zeros((2, 3))
        bar[cart, 1] = 1
        g = self.client.gradient({2000: (bar, None)}, wrt=("stiffness", "rest", "axes"))
        self.assertAlmostEqual(g.stiffness[0], -math.sin(3) / 12, delta=1e-6)
        self.assertAlmostEqual(g.rest[0], 1 - math.cos(3), delta=1e-6)
        after = self.client.descend(g, 2.0, wrt=("stiffness",))
        self.assertEqual(after.stiffness[0], 18 - 2 * g.stiffness[0])
        with self.assertRaisesRegex(Refused, "follow from poses"):
            self.client.step(1, record=True)
            g = self.client.gradient({1: (bar, None)}, wrt=("lengths",))
            self.client.descend(g, 1.0, wrt=("lengths",))

    def test_joints_break(self):
        scene = Scene(gravity=(0, -10), dt=1 / 60)
        hook = scene.static()
        ball = scene.dynamic(position=(0, -1), mass=1, inertia=1)
        scene.join("distance", hook, ball, (0, 0), anchor_b=(0, -1), break_force=9.9)
        self.client.open(scene)
        state = self.client.step(61, every=0)[-1]
        self.assertAlmostEqual(state.q[ball, 2], -6, delta=1e-12)  # falls from the second step on

    def test_gradient_of_the_free_body(self):
        self.client.open(free_body())
        self.client.step(4, every=0, record=True)
        bar = np.array([[0, 1.0, 0]])
        g = self.client.gradient({4: (bar, None), 0: (None, 7 * bar)}, cost=1.5,
                                 wrt=("q0", "v0", "mass", "force", "force_steps", "dt"))
        s = 0.0625 * 10
        self.assertEqual(g.cost, 1.5)
        self.assertEqual((g.first_step, g.recorded_steps), (0, 4))
        np.testing.assert_allclose(g.q0, [[0, 1, 0]], atol=1e-15)
        np.testing.assert_allclose(g.v0, [[0, 8, 0]], atol=1e-15)
        np.testing.assert_allclose(g.mass, [-5 * s / 4], atol=1e-15)
        np.testing.assert_allclose(g.force, [[0, s / 2, 0]], atol=1e-15)
        self.assertEqual(g.force_steps.shape, (4, 1, 3))
        np.testing.assert_allclose(g.force_steps[:, 0, 1], np.arange(4, 0, -1) * 0.0625 / 2, atol=1e-15)
        # d/dh (n h v_0 + (F/m) h^2 n (n + 1)/2)
        np.testing.assert_allclose(g.dt, [4 * 3 + 2 * 2.5 * 0.25 * 10], atol=1e-13)
        self.assertIsNone(g.inertia)

    def test_forces_of_steps_and_tables(self):
        scene = Scene(gravity=(0, 0), dt=0.5)
        scene.dynamic(circle(1), mass=2, inertia=1, forces=[[0.25, 0, 3, 0], [0.625, 0, 0, 0]])
        self.client.open(scene)
        extra = np.zeros((2, 1, 3))
        extra[1, 0, 2] = 8
        state = self.client.step(2, forces=extra)[-1]
        # 3 N for 0.375 s along x; 8 N for one step along y
        np.testing.assert_allclose(state.v[0], [0, 3 * 0.375 / 2, 8 * 0.5 / 2], atol=1e-15)

    def test_descend(self):
        self.client.open(free_body())
        self.client.step(4, every=0, record=True)
        g = self.client.gradient({4: (np.array([[0, 1.0, 0]]), None)}, wrt=("mass", "q0"))
        p = self.client.descend(g, rate=0.5)
        self.assertAlmostEqual(p.mass[0], 2 - 0.5 * g.mass[0], delta=1e-15)
        np.testing.assert_allclose(p.q, -0.5 * g.q0, atol=1e-15)
        self.assertEqual(self.client.step(1)[0].step, 1)

    def test_snapshots(self):
        self.client.open(free_body())
        self.client.step(2)
        self.client.snapshot(1)
        first = self.client.step(3)[-1]
        self.client.restore(1)
        self.assertEqual(self.client.state().step, 2)
        again = self.client.step(3)[-1]
        self.assertEqual(again.step, 5)
        np.testing.assert_array_equal(again.q, first.q)
        self.client.reset()
        self.assertEqual(self.client.state().step, 0)
        self.client.keep_alive()

    def test_contacts(self):
        scene = Scene(dt=0.01)
        scene.static(box(10, 2), position=(0, -1))
        scene.dynamic(box(1, 1), position=(0, 0.5), mass=2)
        self.client.open(scene)
        state = self.client.step(1, contacts=True)[0]
        self.assertEqual(len(state.contacts), 2)
        # weight over one step, split at two corners
        for contact in state.contacts:
            self.assertAlmostEqual(contact.impulse[0], 2 * 9.81 * 0.01 / 2, delta=1e-12)
            self.assertAlmostEqual(abs(contact.normal[1]), 1, delta=1e-12)

    def test_callback_comes_in_order(self):
        self.client.open(free_body())
        seen = []
        self.client.step(50, every=7, on_state=lambda s: seen.append(s.step))
        self.assertEqual(seen, [7, 14, 21, 28, 35, 42, 49, 50])

    def test_large_scene(self):
        scene = Scene(gravity=(0, 0))
        rng = np.random.default_rng(1)
        places = rng.uniform(-1e4, 1e4, (2000, 2))
        for x, y in places:
            scene.dynamic(circle(0.5), position=(x, y), mass=1, name="a body with a long name")
        self.client.open(scene)
        state = self.client.step(1)[0]
        np.testing.assert_array_equal(state.q[:, 1:], places)

    def test_refusals(self):
        with self.assertRaisesRegex(SessionLost, "open a scene first"):
            self.client.step(1)
        with self.assertRaisesRegex(Refused, "no_such_setting"):
            self.client.open(Scene(settings={"no_such_setting": 1}))
        self.client.open(free_body())
        with self.assertRaises(Refused):
            self.client.gradient({4: (np.zeros((1, 3)), None)})  # nothing is recorded
        with self.assertRaises(Refused):
            self.client.restore(3)
        with self.assertRaisesRegex(Refused, "--max-steps"):
            self.client.step(10**9)  # and no list of so many states
        with self.assertRaisesRegex(CaromError, "colour: not one of q0"):
            self.client.gradient({}, wrt="colour")
        self.assertEqual(self.client.step(1)[0].step, 1)  # the session goes on

    def test_files_are_opened(self):
        self.client.open(SCENES / "f_pendulum.json")
        first = self.client.step(1)[0]
        self.client.open(Scene.from_json(SCENES / "f_pendulum.json").to_json())
        np.testing.assert_array_equal(self.client.step(1)[0].q, first.q)

    def test_failed_computation(self):
        scene = Scene.from_json(SCENES / "a_slide.json")
        scene.settings.update(accept=1e-300, inexact=1e-300)
        self.client.open(scene)
        with self.assertRaisesRegex(ComputationFailed, "step 1") as raised:
            self.client.step(5)
        self.assertEqual([s.step for s in raised.exception.states], [0])

    def test_lost_session(self):
        self.client.open(free_body())
        self.client.step(3)
        other = Client(self.server.url)
        other.protocol.client_id = self.client.protocol.client_id
        other.protocol._seq = self.client.protocol._seq
        other.scene = self.client.scene
        other.close()
        with self.assertRaises(SessionLost):
            self.client.step(1)
        self.client.open(free_body())
        self.assertEqual(self.client.step(1)[0].step, 1)

    @needs_carom
    def test_trajectory_equals_the_command_lines(self):
        for name in ("e_cradle", "l_arch12", "f_double"):
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, "t.jsonl")
                carom("run", SCENES / f"{name}.json", "--out", path)
                reference = Trajectory.read(path)
            scene = Scene.from_json(SCENES / f"{name}.json")
            self.client.open(scene)
            stride = int(reference.step[1])
            states = [self.client.state(), *self.client.step(int(reference.step[-1]), every=stride)]
            mine = Trajectory.of_states(states, scene.dt, name)
            np.testing.assert_array_equal(mine.step, reference.step)
            np.testing.assert_array_equal(mine.q, reference.q)
            np.testing.assert_array_equal(mine.v, reference.v)

    @needs_carom
    def test_gradient_equals_the_command_lines(self):
        path = SCENES / "e_cradle.json"
        loss = {"terms": [{"body": 5, "component": "y"}, {"body": 2, "component": "vx", "step": 40}]}
        result = json.loads(carom("gradient", path, "--loss", "-", text=json.dumps(loss)))
        scene = Scene.from_json(path)
        self.client.open(scene)
        states = self.client.step(90, record=True)
        n = len(scene.bodies)
        q_bar, v_bar = np.zeros((n, 3)), np.zeros((n, 3))
        q_bar[5, 2] = v_bar[2, 1] = 1
        names = [name for name in result["gradient"]]
        g = self.client.gradient({90: (q_bar, None), 40: (None, v_bar)}, wrt=names)
        self.assertEqual(result["loss"], states[89].q[5, 2] + states[39].v[2, 1])
        for name in names:
            if name == "vertices":
                flat = [x for body in result["gradient"][name] for point in body for x in point]
            else:
                flat = np.ravel(result["gradient"][name])
            np.testing.assert_array_equal(np.ravel(getattr(g, name)), flat, name)


@needs_caromd
class Asynchronous(WithServer):
    def test_several_under_way(self):
        async def session():
            async with AsyncClient(self.server.url) as client:
                await client.open(free_body())
                parts = await asyncio.gather(*[client.step(10, every=5) for _ in range(40)])
                return [s.step for part in parts for s in part]

        self.assertEqual(asyncio.run(session()), list(range(5, 401, 5)))

    def test_sessions_side_by_side(self):
        async def one(speed):
            async with AsyncClient(self.server.url) as client:
                scene = free_body()
                scene.bodies[0].velocity = (speed, 0)
                scene.bodies[0].forces = []
                await client.open(scene)
                states = await client.step(100, every=0)
                return states[0].q[0, 1]

        async def all_of_them():
            return await asyncio.gather(*[one(float(k)) for k in range(10)])

        self.assertEqual(asyncio.run(all_of_them()), [25.0 * k for k in range(10)])

    def test_errors_come_through(self):
        async def session():
            async with AsyncClient(self.server.url) as client:
                await client.open(free_body())
                with self.assertRaises(Refused):
                    await client.restore(9)
                return (await client.step(1))[0].step

        self.assertEqual(asyncio.run(session()), 1)


class WithoutServer(unittest.TestCase):
    def test_nobody_listens(self):
        with self.assertRaisesRegex(NoServer, r"no server at tcpq://127.0.0.1:9 .* --hub 127.0.0.1:9"):
            Client("tcpq://127.0.0.1:9")

    def test_no_program(self):
        with self.assertRaisesRegex(NoServer, "there is no program /nonexistent/caromd"):
            Server("/nonexistent/caromd")

    @needs_caromd
    def test_wrong_options(self):
        with self.assertRaisesRegex(NoServer, "ended with exit code"):
            Server(CAROMD, "--no-such-option")

    @needs_caromd
    def test_another_name_is_not_heard(self):
        with Server(CAROMD, "--name", "lab") as server:
            with Client(server.url, name="lab") as client:
                client.open(free_body())
                self.assertEqual(client.step(1)[0].step, 1)
            client = Client(server.url, timeout=0.3)
            with self.assertRaisesRegex(NoServer, "no answer from a server"):
                client.open(free_body())

    @needs_caromd
    def test_a_server_that_dies(self):
        server = Server(CAROMD)
        with Client(server.url, timeout=2) as client:
            client.open(free_body())
            killer = threading.Timer(0.2, os.kill, (server.process.pid, signal.SIGKILL))
            killer.start()
            with self.assertRaises(NoServer):
                while True:
                    client.step(100)
            killer.join()
        server.stop()


if __name__ == "__main__":
    unittest.main()
