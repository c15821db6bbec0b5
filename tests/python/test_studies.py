"""The studies of clients/examples/studies find what they look for."""

import os
import subprocess
import sys
import unittest
from pathlib import Path

import numpy as np
from carom import Client, Server
from support import CAROMD, needs_caromd

STUDIES = Path(__file__).parents[2] / "clients" / "examples" / "studies"
sys.path.insert(0, str(STUDIES))

CART_POLE = os.environ.get("CAROM_CART_POLE", "")


@needs_caromd
class Billiard(unittest.TestCase):
    def test_gradient_is_that_of_the_loss(self):
        import billiard

        with Server(CAROMD) as server, Client(server.url) as client:
            data, _, _ = billiard.run(client, billiard.TRUTH)
            at = billiard.TRUTH * 1.02
            _, slope, _ = billiard.loss_and_gradient(client, at, data, billiard.STEPS)
            for k in range(len(at)):
                h = 1e-6 * np.eye(len(at))[k]
                up, _, _ = billiard.loss_and_gradient(client, at + h, data, billiard.STEPS)
                down, _, _ = billiard.loss_and_gradient(client, at - h, data, billiard.STEPS)
                # rounding 1e-16/h, amplified by the collisions, and h^2
                self.assertAlmostEqual((up - down) / 2e-6, slope[k], delta=1e-6 * np.abs(slope).max())

    def test_velocities_and_friction_are_found(self):
        import billiard

        with Server(CAROMD) as server, Client(server.url) as client:
            data, _, _ = billiard.run(client, billiard.TRUTH)
            history = billiard.search(client, data, billiard.START)
        # the loss ends below 1e-14 m^2, with positions that depend on the unknowns by 0.1 to 10
        self.assertLess(np.abs(history[-1][0] - billiard.TRUTH).max(), 1e-5)


@unittest.skipUnless(CART_POLE, "skipped: CAROM_CART_POLE names no program")
class CartPole(unittest.TestCase):
    def test_it_is_swung_up(self):
        output = subprocess.run([CART_POLE], check=True, capture_output=True, text=True).stdout
        rows = [line.split(",") for line in output.splitlines()]
        costs = [float(row[2]) for row in rows if row[0] == "round"]
        states = np.array([row[1:] for row in rows if row[0] == "state"], float)
        self.assertTrue(all(after < before or after == before for before, after in zip(costs, costs[1:])))
        # the price of a degree off is 0.15 at the end, that of the whole swing 0.2
        self.assertLess(abs(states[-1, 2] - np.pi), np.radians(1))
        self.assertLess(abs(states[-1, 1]), 0.02)
        self.assertEqual(states[0, 2], 0)


if __name__ == "__main__":
    unittest.main()
