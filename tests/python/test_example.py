"""The client of the README runs as it stands, on the default address or another."""

import math
import subprocess
import sys
import unittest
from pathlib import Path

from carom import Server
from support import CAROMD, needs_caromd

EXAMPLE = Path(__file__).parents[2] / "clients" / "examples" / "client.py"


@needs_caromd
class Example(unittest.TestCase):
    def test_it_runs(self):
        with Server(CAROMD) as server:
            call = subprocess.run([sys.executable, EXAMPLE, server.url], capture_output=True, text=True)
        self.assertEqual(call.returncode, 0, call.stderr)
        numbers = [float(line.split(":")[1]) for line in call.stdout.splitlines()]
        self.assertEqual(len(numbers), 3)
        self.assertTrue(all(map(math.isfinite, numbers)))
        # dropped from 1 m the ball has bounced once: it is below its first height, and the higher
        # it starts, the later it hits; with more restitution it is higher
        self.assertLess(numbers[0], 1.25)
        self.assertGreater(numbers[2], 0)


if __name__ == "__main__":
    unittest.main()
