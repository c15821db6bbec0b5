"""The demo finds the mass, and its chain rule is that of the loss."""

import math
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from carom import Client, Server
from carom import demo
from support import CAROMD, needs_caromd


@needs_caromd
class Demo(unittest.TestCase):
    def test_slope_is_the_derivative_by_the_logarithm_of_the_mass(self):
        with Server(CAROMD) as server, Client(server.url) as client:
            clock = demo.Clock()
            _, data = demo.run(client, demo.TRUE_MASS, clock, record=False)
            h = 1e-5
            _, slope, _ = demo.loss_and_slope(client, 3.0, data, clock)
            up, _, _ = demo.loss_and_slope(client, 3.0 * math.exp(h), data, clock)
            down, _, _ = demo.loss_and_slope(client, 3.0 * math.exp(-h), data, clock)
            # h^2 and 1e-16/h, amplified by the swinging of ten links over ten seconds
            self.assertAlmostEqual((up - down) / (2 * h), slope, delta=1e-6 * abs(slope))

    def test_any_start(self):
        with Server(CAROMD) as server, Client(server.url) as client:
            _, data = demo.run(client, demo.TRUE_MASS, demo.Clock(), record=False)
            for start in (0.1, 2.0, 50.0):
                search, mass = demo.infer(client, data, demo.Clock(), lambda *_: None, start)
                self.assertLess(abs(mass / demo.TRUE_MASS - 1), 0.01)
                self.assertLessEqual(len(search.masses), 40)

    def test_program(self):
        with tempfile.TemporaryDirectory() as folder:
            call = subprocess.run(
                [sys.executable, "-m", "carom.demo", "--caromd", CAROMD, "--out", folder],
                capture_output=True, text=True)
            self.assertEqual(call.returncode, 0, call.stderr)
            self.assertIn("ms per step", call.stdout)
            self.assertGreater(Path(folder, "chain.png").stat().st_size, 10000)

    def test_no_folder(self):
        with tempfile.NamedTemporaryFile() as file:
            call = subprocess.run(
                [sys.executable, "-m", "carom.demo", "--caromd", CAROMD, "--out", file.name],
                capture_output=True, text=True)
        self.assertEqual(call.returncode, 1)
        self.assertIn(f"{file.name}: the picture cannot go there: File exists", call.stderr)
        self.assertEqual(call.stdout, "")  # told before the search, not after it

    def test_no_server(self):
        call = subprocess.run([sys.executable, "-m", "carom.demo", "--caromd", "/nonexistent/caromd"],
                              capture_output=True, text=True)
        self.assertEqual(call.returncode, 1)
        self.assertIn("there is no program /nonexistent/caromd", call.stderr)


if __name__ == "__main__":
    unittest.main()
