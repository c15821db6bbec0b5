"""Trajectories: read from the JSON lines of `carom run`, or made of States."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .errors import CaromError

FORMAT = "carom-trajectory/1"


@dataclass
class Trajectory:
    scene: str
    dt: float  # [s]
    step: np.ndarray  # (samples,)
    t: np.ndarray  # (samples,) [s]
    q: np.ndarray  # (samples, n, 3): angle, x, y
    v: np.ndarray  # (samples, n, 3): omega, vx, vy
    summary: dict = field(default_factory=dict)

    def __len__(self):
        return len(self.step)

    @classmethod
    def read(cls, path):
        """Trajectory of a file of JSON lines, format carom-trajectory/1."""
        lines = Path(path).read_text(encoding="utf-8").splitlines()
        try:
            records = [json.loads(line) for line in lines if line.strip()]
        except json.JSONDecodeError as error:
            raise CaromError(f"{path}: not JSON lines: {error}") from None
        if not records or records[0].get("format") != FORMAT:
            raise CaromError(f"{path}: the first line does not say {FORMAT}")
        head = records[0]
        samples = [r for r in records[1:] if "step" in r]
        summary = next((r["summary"] for r in records if "summary" in r), {})
        return cls._build(head["scene"], head["dt"], head["bodies"], samples, summary)

    @classmethod
    def of_states(cls, states, dt, scene=""):
        """Trajectory of States, as a client gets them."""
        samples = [{"step": s.step, "t": s.time, "q": s.q, "v": s.v} for s in states]
        n = len(states[0].q) if states else 0
        return cls._build(scene, dt, n, samples, {})

    @classmethod
    def _build(cls, scene, dt, n, samples, summary):
        def stack(key):
            return np.array([np.ravel(s[key]) for s in samples], float).reshape(-1, n, 3)

        return cls(scene, dt, np.array([s["step"] for s in samples], int),
                   np.array([s["t"] for s in samples], float), stack("q"), stack("v"), summary)

    def write(self, path):
        """The same JSON lines as `carom run`; numbers read back exactly."""
        n = self.q.shape[1]
        lines = [{"format": FORMAT, "scene": self.scene, "bodies": n, "dt": self.dt}]
        lines += [{"step": int(self.step[k]), "t": float(self.t[k]), "q": self.q[k].ravel().tolist(),
                   "v": self.v[k].ravel().tolist()} for k in range(len(self))]
        lines.append({"summary": self.summary})
        text = "".join(json.dumps(line, separators=(",", ":")) + "\n" for line in lines)
        Path(path).write_text(text, encoding="ascii")
