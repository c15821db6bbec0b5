"""What can go wrong, as exceptions whose text says what to do about it."""


class CaromError(Exception):
    """Base of all errors of this package."""


class SceneError(CaromError):
    """A scene is not valid; the text starts with the place, like bodies[3].mass."""


class NoServer(CaromError):
    """Nothing listens at the address of the server."""


class ServerTimeout(CaromError):
    """The server did not answer in time."""


class Refused(CaromError):
    """The server says that the request is not valid, and why."""


class ComputationFailed(CaromError):
    """The computation failed at some step; `states` holds what was computed before."""

    def __init__(self, text, states=()):
        super().__init__(text)
        self.states = list(states)


class SessionLost(CaromError):
    """The session expired, or the server was started again: open the scene once more."""
