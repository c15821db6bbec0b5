"""Programs of the build under test, named by the environment (see tests/CMakeLists.txt)."""

import os
import subprocess
import unittest
from pathlib import Path

SCENES = Path(__file__).parents[1] / "data" / "scenes"
CAROM = os.environ.get("CAROM_PROGRAM", "")
CAROMD = os.environ.get("CAROM_DAEMON", "")

needs_carom = unittest.skipUnless(CAROM, "CAROM_PROGRAM does not name the program carom")
needs_caromd = unittest.skipUnless(CAROMD, "CAROM_DAEMON does not name the program caromd")


def carom(*arguments, text=None):
    """Standard output of `carom ARGUMENTS`."""
    return subprocess.run([CAROM, *map(str, arguments)], input=text, capture_output=True, text=True,
                          check=True).stdout
