"""Trajectories: what `carom run` writes is read exactly; pictures are drawn."""

import tempfile
import unittest
from pathlib import Path

import numpy as np
from carom import CaromError, Scene, State, Trajectory
from support import SCENES, carom, needs_carom

try:
    import matplotlib

    matplotlib.use("Agg")
except ImportError:
    matplotlib = None


class Reading(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name, "t.jsonl")

    def test_round_trip(self):
        rng = np.random.default_rng(1)
        states = [State(k, 0.1 * k, rng.normal(size=(3, 3)), rng.normal(size=(3, 3))) for k in range(4)]
        t = Trajectory.of_states(states, 0.1, "s")
        t.write(self.path)
        again = Trajectory.read(self.path)
        for name in ("step", "t", "q", "v"):
            np.testing.assert_array_equal(getattr(again, name), getattr(t, name))
        self.assertEqual((again.scene, again.dt, len(again)), ("s", 0.1, 4))

    @needs_carom
    def test_command_line(self):
        carom("run", SCENES / "f_double.json", "--out", self.path)
        t = Trajectory.read(self.path)
        scene = Scene.from_json(SCENES / "f_double.json")
        self.assertEqual(len(t), 91)
        self.assertEqual(t.scene, "f_double")
        np.testing.assert_array_equal(t.q[0], scene.q())
        self.assertEqual(t.summary["steps"], 180)

    def test_other_files(self):
        for text in ("", "{}", '{"format":"carom-scene/1"}', "no json"):
            self.path.write_text(text)
            with self.assertRaises(CaromError):
                Trajectory.read(self.path)


@unittest.skipUnless(matplotlib, "matplotlib is not installed")
class Pictures(unittest.TestCase):
    def test_scene_errors_convergence(self):
        import matplotlib.pyplot as plt
        from carom import plot

        figure, axes = plt.subplots(2, 2)
        scene = Scene.from_json(SCENES / "e_cradle.json")
        plot.draw_scene(axes[0, 0], scene)
        self.assertEqual(len(axes[0, 0].patches), len(scene.bodies))
        plot.plot_errors(axes[0, 1], [1, 2, 4], [1e-1, 0, 1e-3], label="carom")
        np.testing.assert_array_equal(axes[0, 1].lines[0].get_xdata(), [1, 4])
        plot.plot_convergence(axes[1, 0], axes[1, 1], [1, 0.1], [3, 4], truth=5)
        with tempfile.TemporaryDirectory() as folder:
            figure.savefig(Path(folder, "p.png"))
        plt.close(figure)


if __name__ == "__main__":
    unittest.main()
