"""carom: scenes, and a client that steps and differentiates them in a server (caromd) over LCM.

    import numpy as np
    from carom import Client, Scene, box, circle

    scene = Scene()
    scene.static(box(10, 2), position=(0, -1))
    ball = scene.dynamic(circle(0.25), position=(0, 2), mass=1)
    with Client() as client:
        client.open(scene)
        state = client.step(60, record=True)[-1]
        q_bar = np.zeros_like(state.q)
        q_bar[ball, 2] = 1  # d height / d q
        gradient = client.gradient({60: (q_bar, None)}, wrt=("q0", "mass"))

docs/python.md is the manual.
"""

from importlib import import_module

from .errors import (
    CaromError,
    ComputationFailed,
    NoServer,
    Refused,
    SceneError,
    ServerTimeout,
    SessionLost,
)
from .results import Gradient, State
from .scene import Body, Joint, Scene
from .server import Server
from .shapes import Shape, box, capsule, circle, hull, segment
from .trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "AsyncClient", "Body", "CaromError", "Client", "ComputationFailed", "Gradient", "Joint",
    "NoServer", "Refused", "Scene", "SceneError", "Server", "ServerTimeout", "SessionLost", "Shape",
    "State", "Trajectory", "box", "capsule", "circle", "hull", "segment",
]

# The clients need the generated messages; scenes and trajectories do without.
_CLIENTS = {"Client": ".client", "AsyncClient": ".aio"}


def __getattr__(name):
    if name in _CLIENTS:
        return getattr(import_module(_CLIENTS[name], __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
