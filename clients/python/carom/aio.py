"""The asynchronous client: the same calls as awaitables, several of them under way at once."""

from __future__ import annotations

import asyncio
import time

from . import transport
from .calls import Calls
from .errors import CaromError, NoServer
from .exchange import START, Protocol


class AsyncClient(Calls):
    """Like Client, inside a running event loop.

    A call sends its request at once and returns an awaitable; requests are executed in the order of
    the calls:

        async with AsyncClient() as client:
            await client.open(scene)
            halves = [client.step(100), client.step(100)]  # both under way
            first, second = await asyncio.gather(*halves)
    """

    def __init__(self, url=transport.DEFAULT_URL, name="", timeout=10.0):
        self.url = url
        self.protocol = Protocol(self._publish, name, timeout, where=f" at {url}")
        self._network = transport.connect(url, self.protocol.suffix, self.protocol.receive)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._network.fileno(), self._readable)
        self._waiting = {}  # exchange -> (future, finish)
        self._timer = None

    async def __aenter__(self):
        return self

    async def __aexit__(self, kind, error, trace):
        await self.close()

    async def close(self):
        """Closes the session, when the server still answers, and leaves the network."""
        if self._network is None:
            return
        try:
            if self.scene is not None and not self.protocol.lost:
                self.protocol.timeout = min(self.protocol.timeout, 1.0)
                await self.close_session()
        except CaromError:
            pass
        self._leave()

    def _leave(self):
        if self._timer:
            self._timer.cancel()
        if self._network is not None:
            self._loop.remove_reader(self._network.fileno())
        self._network = None

    def _publish(self, channel, data):
        if self._network is None:
            raise CaromError("the client is closed")
        try:
            self._network.publish(channel, data)
        except (OSError, RuntimeError):
            raise NoServer(f"the connection to {self.url} broke; {START}") from None

    def _run(self, exchange, finish):
        future = self._loop.create_future()
        self._waiting[id(exchange)] = (exchange, future, finish)
        self._settle()
        return future

    def _readable(self):
        try:
            self._network.handle()
        except (OSError, RuntimeError):
            self._break(NoServer(f"the connection to {self.url} broke; {START}"))
            return
        self._settle()

    def _tick(self):
        try:
            self.protocol.poll()
        except CaromError as error:
            self._break(error)
            return
        self._settle()

    def _break(self, error):
        self._leave()
        for _, future, _ in self._waiting.values():
            if not future.done():
                future.set_exception(error)
        self._waiting.clear()

    def _settle(self):
        """Resolves what is done and sets the timer for the next repetition."""
        for key, (exchange, future, finish) in list(self._waiting.items()):
            if not exchange.done:
                continue
            del self._waiting[key]
            if future.done():
                continue
            try:
                future.set_result(finish(exchange))
            except CaromError as error:
                future.set_exception(error)
        if self._timer:
            self._timer.cancel()
        due = self.protocol.next_time()
        self._timer = None
        if due is not None and self._network is not None:
            self._timer = self._loop.call_later(max(0.0, due - time.monotonic()), self._tick)
