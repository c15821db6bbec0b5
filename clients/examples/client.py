"""A ball on a floor in a step server: where it comes to lie, and how its first height matters."""

import sys

import numpy as np
from carom import Client, Scene, box, circle

scene = Scene(dt=1 / 60)
scene.static(box(10, 2), position=(0, -1), friction=0.5, restitution=0.8)
ball = scene.dynamic(circle(0.25), position=(0, 1.25), mass=1, restitution=0.8)

with Client(*sys.argv[1:]) as client:  # tcpq://127.0.0.1:7700, where caromd listens by default
    client.open(scene)
    last = client.step(60, record=True)[-1]
    print("height after one second:", last.q[ball, 2])
    q_bar = np.zeros_like(last.q)
    q_bar[ball, 2] = 1  # the loss is that height
    gradient = client.gradient({60: (q_bar, None)}, wrt=("q0", "restitution"))
    print("derivative by the first height:", gradient.q0[ball, 2])
    print("derivative by the restitution of the ball:", gradient.restitution[ball])
