"""The LCM network, and the check that somebody is there before LCM is asked to connect."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

import lcm

from .errors import NoServer
from .exchange import ANSWERS, START

DEFAULT_URL = "tcpq://127.0.0.1:7700"  # where caromd listens by default


def _probe(url):
    """LCM waits and prints when a tcpq hub is not there; a plain connection tells at once."""
    parts = urlsplit(url)
    if parts.scheme != "tcpq":
        return
    host, port = parts.hostname or "127.0.0.1", parts.port or 7700
    try:
        socket.create_connection((host, port), timeout=5).close()
    except OSError as error:
        hub = "" if (host, port) == ("127.0.0.1", 7700) else f" --hub {host}:{port}"
        raise NoServer(f"no server at {url} ({error.strerror or error}); {START}{hub}") from None


def connect(url, suffix, receive):
    """An lcm.LCM that hands every answer to receive(channel, bytes)."""
    _probe(url)
    try:
        network = lcm.LCM(url)
    except (RuntimeError, OSError) as error:
        raise NoServer(f"cannot join {url}: {error}") from None
    for channel in ANSWERS:
        network.subscribe(channel + suffix, receive).set_queue_capacity(0)
    return network
