"""The blocking client: every call returns with its answer, or raises."""

from __future__ import annotations

import select
import time

from . import transport
from .calls import Calls
from .errors import CaromError, NoServer
from .exchange import START, Protocol


class Client(Calls):
    """A session with a server.

    url: an LCM network, like tcpq://127.0.0.1:7700 (the default) or udpm://239.255.76.67:7667?ttl=0.
    name: the one given to caromd with --name.  timeout: seconds without a sign of life."""

    def __init__(self, url=transport.DEFAULT_URL, name="", timeout=10.0):
        self.url = url
        self.protocol = Protocol(self._publish, name, timeout, where=f" at {url}")
        self._network = transport.connect(url, self.protocol.suffix, self.protocol.receive)

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        self.close()

    def close(self):
        """Closes the session, when the server still answers, and leaves the network."""
        if self._network is None:
            return
        try:
            if self.scene is not None and not self.protocol.lost:
                self.protocol.timeout = min(self.protocol.timeout, 1.0)
                self.close_session()
        except CaromError:
            pass
        self._network = None

    def _publish(self, channel, data):
        if self._network is None:
            raise CaromError("the client is closed")
        try:
            self._network.publish(channel, data)
        except (OSError, RuntimeError):
            raise NoServer(f"the connection to {self.url} broke; {START}") from None

    def _run(self, exchange, finish):
        while not exchange.done:
            left = max(0.0, self.protocol.next_time() - time.monotonic())
            if select.select([self._network.fileno()], [], [], left)[0]:
                self._handle()
            self.protocol.poll()
        return finish(exchange)

    def _handle(self):
        try:
            self._network.handle()
        except (OSError, RuntimeError):
            raise NoServer(f"the connection to {self.url} broke; {START}") from None
