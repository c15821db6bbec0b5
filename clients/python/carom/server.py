"""A caromd of one's own, started and stopped with a `with` block."""

from __future__ import annotations

import select
import shutil
import signal
import subprocess
import time

from .errors import CaromError, NoServer


class Server:
    """Runs `caromd --hub 127.0.0.1:0` (a free port) and knows its url.

    program: path of caromd.  options: more of its command line."""

    def __init__(self, program="caromd", *options, timeout=10.0):
        found = shutil.which(program)
        if found is None:
            raise NoServer(f"there is no program {program}; build it, or say where it is")
        self.process = subprocess.Popen([found, "--hub", "127.0.0.1:0", *options],
                                        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE)
        try:
            self.url = self._wait_ready(timeout)
        except CaromError:
            self.process.kill()
            self.process.wait()
            self.process.stdout.close()
            raise

    def _wait_ready(self, timeout):
        """The url of the line `ready URL`, which is printed as soon as clients can connect."""
        end = time.monotonic() + timeout
        while True:
            left = end - time.monotonic()
            if left <= 0 or not select.select([self.process.stdout], [], [], left)[0]:
                raise NoServer(f"caromd did not get ready within {timeout:g} s")
            line = self.process.stdout.readline().decode(errors="replace")
            if not line:
                raise NoServer(f"caromd ended with exit code {self.process.wait()}")
            if line.startswith("ready "):
                return line.split()[1]

    def stop(self, timeout=10.0):
        """Ends it cleanly; its exit code."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        try:
            self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.process.stdout.close()
        return self.process.returncode

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.stop()
