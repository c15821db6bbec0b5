"""Scenes: building, files, what is sent."""

import json
import math
import os
import tempfile
import unittest
from pathlib import Path

import numpy as np
from carom import Scene, SceneError, box, capsule, circle, hull, segment
from carom.calls import scene_message
from carom.messages import scene_t

SCENES = sorted((Path(__file__).parents[1] / "data" / "scenes").glob("*.json"))
HEAD = {"format": "carom-scene/1"}
BALL = {"mass": 1, "shape": {"type": "circle", "radius": 1}}


class Building(unittest.TestCase):
    def scene(self):
        scene = Scene("s", gravity=(0, -10), dt=0.25, settings={"margin": 1e-5, "project_overlap": True})
        floor = scene.static(box(10, 2), position=(0, -1), friction=0.25)
        ball = scene.dynamic(circle(0.5), position=(1, 2), angle=0.5, velocity=(3, 4), mass=2,
                             angular_velocity=5, forces=[1, 2, 3], name="ball",
                             filter={"mask": 0xFFFFFFFF, "category": 4, "group": -1})
        scene.pin(floor, ball, (0.5, 0.25))
        return scene

    def test_states_and_masses(self):
        scene = self.scene()
        np.testing.assert_array_equal(scene.q(), [[0, 0, -1], [0.5, 1, 2]])
        np.testing.assert_array_equal(scene.v(), [[0, 0, 0], [5, 3, 4]])
        mass, inertia = scene.masses()
        self.assertEqual(mass[1], 2)
        self.assertAlmostEqual(inertia[1], 2 * 0.25 / 2, delta=1e-16)

    def test_index_of_a_body(self):
        scene = self.scene()
        self.assertEqual(scene.q()[scene.bodies[1], 1], 1)

    def test_message(self):
        m = scene_t.decode(scene_message(self.scene()).encode())
        self.assertEqual(m.num_bodies, 2)
        self.assertEqual(dict(zip(m.setting_name, m.setting_value)),
                         {"margin": "1e-05", "project_overlap": "1", "dt": "0.25"})
        self.assertEqual(list(m.q), [0, 0, -1, 0.5, 1, 2])
        self.assertEqual(list(m.force), [0, 0, 0, 1, 2, 3])
        self.assertEqual(list(m.filter_mask), [-1, -1])
        self.assertEqual(list(m.filter_category), [1, 4])
        self.assertEqual(list(m.shape_num_vertices), [4, 1])
        self.assertEqual(list(m.anchor), [0.5, 0.25])

    def test_inertia_of_a_rod(self):
        scene = Scene()
        rod = scene.dynamic(segment((0, 0), (2, 0)), mass=6)
        self.assertAlmostEqual(rod.mass_and_inertia()[1], 6 * 4 / 3, delta=1e-14)

    def test_density(self):
        scene = Scene()
        body = scene.dynamic(box(2, 4), density=5)
        np.testing.assert_allclose(body.mass_and_inertia(), (40, 40 * 20 / 12), rtol=1e-15)


class Mistakes(unittest.TestCase):
    """Refused where they are made, with their place; the scene stays as it was."""

    def refused(self, call, text):
        with self.assertRaisesRegex(SceneError, text):
            call()

    def test_bodies(self):
        cases = [
            (circle(1), {"mass": -1}, r"bodies\[1\].mass: must be > 0, is -1"),
            (circle(1), {"mass": math.nan}, "mass: must be finite"),
            (circle(1), {"mass": "heavy"}, "mass: must be a number, is 'heavy'"),
            (circle(1), {}, "mass: a dynamic body needs"),
            (circle(1), {"density": 0}, "density: must be > 0"),
            (circle(-1), {"mass": 1}, "shape.radius: must be > 0, is -1"),
            (circle(0), {"mass": 1}, "shape.radius: must be > 0, is 0"),
            (box(0, 1), {"mass": 1}, "shape.vertices: the hull has no area"),
            (hull([(0, 0), (0, 1), (1, 0)]), {"mass": 1}, "clockwise; reverse"),
            (hull([(0, 0), (1, 0)]), {"mass": 1}, "three vertices or more, here are 2"),
            (hull([(0, 0), (2, 0), (0.5, 0.5), (0, 2)]), {"mass": 1}, r"vertices\[2\]: not convex"),
            ([circle(1), segment((1, 1), (1, 1))], {"mass": 1}, r"shapes\[1\].vertices: a segment"),
            (circle(1), {"mass": 1, "position": (1,)}, "position: must be 2 numbers"),
            (circle(1), {"mass": 1, "position": "ab"}, r"position\[0\]: must be a number, is 'a'"),
            (circle(1), {"mass": 1, "friction": -0.1}, "friction: must be >= 0"),
            (circle(1), {"mass": 1, "restitution": 1.1}, "restitution: must be 0 to 1, is 1.1"),
            (circle(1), {"mass": 1, "forces": [1, 2]}, "forces: must be 3 numbers"),
            (circle(1), {"mass": 1, "forces": [[1, 0, 0, 0], [1, 0, 0, 0]]}, "times must increase"),
        ]
        scene = Scene()
        scene.static(box(1, 1))
        for shape, fields, text in cases:
            self.refused(lambda: scene.dynamic(shape, **fields), text)
        self.refused(lambda: scene.static(box(1, 1), velocity=(1, 0)), "does not move")
        self.assertEqual(len(scene.bodies), 1)

    def test_joints(self):
        scene = Scene()
        floor, wall = scene.static(box(1, 1)), scene.static(box(1, 1))
        ball = scene.dynamic(circle(1), mass=1)
        self.refused(lambda: scene.pin(floor, ball, (0, math.inf)), r"joints\[0\].anchor\[1\]: must be")
        self.refused(lambda: scene.pin(ball, ball, (0, 0)), "to itself")
        self.refused(lambda: scene.pin(ball, 7, (0, 0)), "body_b: there is no body 7")
        self.refused(lambda: scene.pin(floor, wall, (0, 0)), "neither body is dynamic")
        self.assertEqual(scene.joints, [])

    def test_fields_of_joints(self):
        scene = Scene()
        a, b = scene.dynamic(circle(1), mass=1), scene.dynamic(circle(1), mass=1)
        cases = [("glue", {}, "type: must be one of"), ("weld", {"stiffness": 1}, "stiffness: a weld joint has"),
                 ("prismatic", {}, "axis: must be given"), ("rope", {}, "anchor_b: must be given"),
                 ("wheel", {"axis": (0, 0)}, "axis: is no direction"),
                 ("revolute", {"lower": 1, "upper": 0}, "lower: must be below upper"),
                 ("revolute", {"motor_limit": -1}, "motor_limit: must be >= 0"),
                 ("target", {}, "stiffness: must be given"),
                 ("revolute", {"break_force": 0}, "break_force: must be > 0")]
        for kind, fields, text in cases:
            self.refused(lambda: scene.join(kind, a, b, (0, 0), **fields), text)
        self.assertEqual(scene.joints, [])

    def test_joints_go_to_files_and_back(self):
        scene = Scene()
        a, b = scene.dynamic(circle(1), mass=1), scene.dynamic(circle(1), mass=1)
        scene.join("wheel", a, b, (0, 1), axis=(0, 2), lower=-1, stiffness=3, motor_limit=2, name="w")
        scene.join("rope", a, b, (0, 1), anchor_b=(1, 1), upper=4, collide=False)
        again = Scene.from_json(scene.to_json())
        self.assertEqual(again.joints, scene.joints)

    def test_what_files_do_not_hold(self):
        scene = Scene()
        ball = scene.dynamic(circle(1), mass=1, linear_damping=2)
        self.refused(scene.to_json, r"bodies\[0\].linear_damping: carom-scene/1 has no such key")
        ball.linear_damping, ball.inertia = 0.0, math.inf
        self.refused(scene.to_json, r"bodies\[0\].inertia: carom-scene/1 has no infinite")

    def test_scenes(self):
        self.refused(lambda: Scene(dt=-1), "dt: must be > 0, is -1")
        self.refused(lambda: Scene(gravity=3), "gravity: must be 2 numbers")
        self.refused(lambda: Scene(duration=math.inf), "duration: must be finite")


class Forces(unittest.TestCase):
    def test_impulse_is_exact_for_any_step(self):
        rows = [[0.1, 1, 0, 0], [0.35, 0, 2, 0], [0.7, 0, 0, -3]]
        for n in range(1, 8):
            scene = Scene(dt=1 / n)
            scene.dynamic(mass=1, inertia=1, forces=rows)
            impulse = sum(scene.forces_of_step(k)[0] / n for k in range(n))
            np.testing.assert_allclose(impulse, [0.25, 0.7, -0.9], atol=1e-14)

    def test_no_table(self):
        scene = Scene()
        scene.dynamic(mass=1, inertia=1, forces=[1, 2, 3])
        self.assertIsNone(scene.forces_of_step(0))


class Files(unittest.TestCase):
    def test_scenes_of_the_data(self):
        self.assertEqual(len(SCENES), 18)
        for path in SCENES:
            scene = Scene.from_json(path)
            again = Scene.from_json(json.loads(json.dumps(scene.to_json())))
            self.assertEqual(again.to_json(), scene.to_json(), path.name)
            data = json.loads(path.read_text())
            self.assertEqual(len(scene.bodies), len(data["bodies"]))
            np.testing.assert_array_equal(
                scene.q(), [[b["angle"], *b["position"]] for b in data["bodies"]])

    def test_save(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s.json")
            scene = Scene("x")
            scene.dynamic([circle(1), capsule((-1, 0), (1, 0), 0.5)], mass=1)
            scene.save(path)
            self.assertEqual(Scene.from_json(path).to_json(), scene.to_json())

    def test_names_in_joints(self):
        scene = Scene.from_json({**HEAD, "bodies": [{"name": "a", "type": "static"}, {"name": "b", **BALL}],
                                 "joints": [{"type": "revolute", "body_a": "a", "body_b": "b",
                                             "anchor": [0, 0]}]})
        self.assertEqual((scene.joints[0].body_a, scene.joints[0].body_b), (0, 1))

    def test_faults_name_their_place(self):
        cases = [
            ({}, "format: must be"),
            ({**HEAD, "bodys": []}, "bodys: unknown key"),
            ({**HEAD, "bodies": {}}, "bodies: must be an array"),
            ({**HEAD, "bodies": [None]}, r"bodies\[0\]: must be an object"),
            ({**HEAD, "bodies": [{"mass": 1, "shape": 3}]}, r"bodies\[0\].shape: must be an object"),
            ({**HEAD, "settings": []}, "settings: must be an object"),
            ({**HEAD, "dt": "0.1 s"}, "dt: must be a number, is '0.1 s'"),
            ({**HEAD, "bodies": [{**BALL, "masss": 1}]}, r"bodies\[0\].masss: unknown key"),
            ({**HEAD, "bodies": [{"type": "fixed"}]}, r"bodies\[0\].type: must be one of"),
            ({**HEAD, "bodies": [{}]}, r"bodies\[0\].mass: a dynamic body needs"),
            ({**HEAD, "bodies": [{"mass": 1}]}, r"bodies\[0\].inertia: must be given"),
            ({**HEAD, "bodies": [{**BALL, "density": 1}]}, r"bodies\[0\].density: mass and inertia"),
            ({**HEAD, "bodies": [{"density": 1, "shape": {"type": "circle", "radius": 1,
                                                          "center": [1, 0]}}]},
             r"bodies\[0\].density: the centroid of the shape is at \(1, 0\)"),
            ({**HEAD, "bodies": [{**BALL, "shapes": []}]}, r"bodies\[0\].shapes: stands beside"),
            ({**HEAD, "bodies": [BALL], "joints": [{"type": "glue"}]}, r"joints\[0\].type: must be"),
            ({**HEAD, "bodies": [BALL], "joints": [{"type": "weld", "axis": [1, 0]}]},
             r"joints\[0\].axis: unknown key"),
            ({**HEAD, "bodies": [BALL], "joints": [{"type": "revolute", "body_a": 0, "body_b": 3,
                                                    "anchor": [0, 0]}]}, r"joints\[0\].body_b: there"),
        ]
        for data, text in cases:
            with self.assertRaisesRegex(SceneError, text):
                Scene.from_json(data)

    def test_syntax_and_duplicates(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "s.json")
            for text, message in [('{"format":\n ,}', "line 2, column 2"),
                                  ('{"dt":1,"dt":2}', "dt: the key stands twice")]:
                Path(path).write_text(text)
                with self.assertRaisesRegex(SceneError, message):
                    Scene.from_json(path)


if __name__ == "__main__":
    unittest.main()
