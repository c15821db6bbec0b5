"""Gradients of peers on the problems of problems.c, beside their closed forms.

python bench/gradient/peers.py [--carom PATH/OF/bench_gradient] [engine ...]

Runs the engines that this Python can import (pip install mujoco mujoco-mjx 'jax[cpu]' drake newton
nimblephysics; some want environments of their own: run it once in each) and says which are missing.
CSV on stdout with the columns of bench_gradient: `seconds` of a run with its gradient, compilation not
on the clock, and how much that is over a run alone.

All engines see the same scene: a disc (a sphere in 3-D engines) of 1 kg, radius 0.5 m, in the plane,
above a floor at y = 0.  "slide" and "drop" hold it upright; "oblique" lets it turn, without gravity.
"bounce" needs a coefficient of restitution, which MuJoCo, MJX and Drake do not have.
"""

import argparse
import math
import subprocess
import sys
import time

G, R, MU = 9.81, 0.5, 0.5

# name: gravity, height above the floor, vx, vy, friction, restitution, turns, seconds
SCENES = {
    "slide": (G, 0.0, 3.0, 0.0, MU, 0.0, False, 1.0),
    "drop": (G, 0.3, 4.0, 0.0, MU, 0.0, False, 1.5),
    "oblique": (0.0, 0.6, 1.0, -2.0, 0.8, 0.0, True, 1.0),
    "bounce": (0.0, 0.6, 0.0, -2.0, 0.0, 0.7, True, 1.0),
}
# problem, parameter, scene, which number is moved (height, vx, mu), exact derivative of x (bounce: y)
PROBLEMS = [
    ("sliding stop", "v0", "slide", "vx", 3 / (MU * G)),
    ("sliding stop", "mu", "slide", "mu", -9 / (2 * MU**2 * G)),
    ("drop and slide", "h", "drop", "height", MU),
    ("oblique impact", "h", "oblique", "height", 1 / 6),
    ("oblique impact", "v0", "oblique", "vx", 1 - 0.7 / 3),
    ("wall bounce", "h", "bounce", "height", -0.7),
]
NUMBERS = {"height": 1, "vx": 2, "mu": 4}


def least(call, rounds=5):
    """Its value, and the least processor time of a few calls."""
    best, value = math.inf, None
    start = time.process_time()
    for _ in range(rounds):
        since = time.process_time()
        value = call()
        best = min(best, time.process_time() - since)
        if time.process_time() - start > 5:
            break
    return value, best


def row(problem, parameter, engine, dt, value, exact, forward, gradient):
    error = abs(value / exact - 1) if math.isfinite(value) else math.nan
    print(f"closed,{problem},{engine},{parameter},{dt:.4g},{value:.6g},{exact:.6g},{error:.1e},"
          f"{gradient:.3e},{gradient / forward:.3g},", flush=True)


def moved(scene, number, by):
    numbers = list(SCENES[scene])
    numbers[NUMBERS[number]] += by
    return numbers


def differences(run, engine, dt, eps):
    """Central differences of a run of numbers; run(numbers) is the loss."""
    for problem, parameter, scene, number, exact in PROBLEMS:
        if scene == "bounce":
            continue
        _, forward = least(lambda: run(moved(scene, number, 0)))
        value, both = least(
            lambda: (run(moved(scene, number, eps)) - run(moved(scene, number, -eps))) / (2 * eps))
        row(problem, parameter, engine, dt, value, exact, forward, both)


# --- MuJoCo, and MJX ------------------------------------------------------------------------------


def mujoco_xml(numbers, dt, solref, solver="Newton", iterations=100):
    gravity, _, _, _, mu, _, turns, _ = numbers
    hinge = '<joint type="hinge" axis="0 1 0"/>' if turns else ""
    return f"""<mujoco><option timestep="{dt}" gravity="0 0 {-gravity}" solver="{solver}"
      iterations="{iterations}" tolerance="1e-14" cone="elliptic"/>
      <worldbody><geom type="plane" size="50 50 1" friction="{mu} 0 0" solref="{solref}"/>
      <body pos="0 0 {R}"><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>{hinge}
      <inertial pos="0 0 0" mass="1" diaginertia="0.125 0.125 0.125"/>
      <geom type="sphere" size="{R}" friction="{mu} 0 0" solref="{solref}"/></body>
      </worldbody></mujoco>"""


def mujoco_run(dt, solref):
    import mujoco

    def run(numbers):
        model = mujoco.MjModel.from_xml_string(mujoco_xml(numbers, dt, solref))
        data = mujoco.MjData(model)
        data.qpos[1] = numbers[1]
        data.qvel[0], data.qvel[1] = numbers[2], numbers[3]
        for _ in range(round(numbers[7] / dt)):
            mujoco.mj_step(model, data)
        return float(data.qpos[0])

    return run


def mujoco_differences():
    import mujoco  # noqa: F401  here, or not at all

    for solref, word, eps in (("0.02 1", "default solref", 1e-4), ("0.002 1", "solref 2 dt", 1e-4),
                              ("0.002 1", "solref 2 dt", 1e-2)):
        differences(mujoco_run(1e-3, solref), f"MuJoCo differences of {eps:g} ({word})", 1e-3, eps)


def mjx_reverse():
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    import mujoco
    from mujoco import mjx

    dt = 2e-3
    for problem, parameter, scene, number, exact in PROBLEMS:
        if scene == "bounce":
            continue
        numbers = SCENES[scene]
        xml = mujoco_xml(numbers, dt, "0.02 1", iterations=1).replace(
            'cone="elliptic"', 'cone="pyramidal" ls_iterations="4"')
        model = mjx.put_model(mujoco.MjModel.from_xml_string(xml))
        data = mjx.make_data(model)
        steps = round(numbers[7] / dt)

        def loss(x, model=model, data=data, numbers=numbers, number=number, steps=steps):
            height = numbers[1] + (x if number == "height" else 0)
            vx = numbers[2] + (x if number == "vx" else 0)
            if number == "mu":
                model = model.replace(
                    geom_friction=model.geom_friction.at[:, 0].set(numbers[4] + x))
            data = data.replace(qpos=data.qpos.at[1].set(height),
                                qvel=data.qvel.at[0].set(vx).at[1].set(numbers[3]))
            data, _ = jax.lax.scan(lambda d, _: (mjx.step(model, d), None), data, None, length=steps)
            return data.qpos[0]

        forward_call, gradient_call = jax.jit(loss), jax.jit(jax.grad(loss))
        forward_call(0.0), gradient_call(0.0)  # compiled
        _, forward = least(lambda: jax.block_until_ready(forward_call(0.0)))
        value, both = least(lambda: float(gradient_call(0.0)))
        row(problem, parameter, "MJX reverse (1 Newton iteration)", dt, value, exact, forward, both)


# --- Drake ----------------------------------------------------------------------------------------


def drake_forward():
    import numpy as np
    from pydrake.autodiffutils import AutoDiffXd
    from pydrake.geometry import HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import PlanarJoint, PrismaticJoint, SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator, Simulator_
    from pydrake.systems.framework import DiagramBuilder

    dt = 1e-3

    def build(numbers):
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, dt)
        inertia = SpatialInertia(1.0, np.zeros(3), UnitInertia(0.125, 0.125, 0.125))
        friction = CoulombFriction(numbers[4], numbers[4])
        ball = plant.AddRigidBody("ball", inertia)
        plant.RegisterCollisionGeometry(ball, RigidTransform(), Sphere(R), "ball", friction)
        plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform([0, 0, -R]), HalfSpace(),
                                        "floor", friction)
        if numbers[6]:
            from pydrake.math import RotationMatrix

            upright = RigidTransform(RotationMatrix.MakeXRotation(math.pi / 2), [0, 0, 0])
            plant.AddJoint(PlanarJoint("plane", plant.AddFrame(frame_of(plant, upright)),
                                       plant.AddFrame(frame_of(plant, upright, ball)), [0, 0, 0]))
        else:
            rail = plant.AddRigidBody("rail", SpatialInertia(1e-9, np.zeros(3),
                                                             UnitInertia(1, 1, 1)))
            plant.AddJoint(PrismaticJoint("x", plant.world_frame(), rail.body_frame(), [1, 0, 0]))
            plant.AddJoint(PrismaticJoint("z", rail.body_frame(), ball.body_frame(), [0, 0, 1]))
        plant.mutable_gravity_field().set_gravity_vector([0, 0, -numbers[0]])
        plant.Finalize()
        return builder.Build(), plant

    def frame_of(plant, pose, body=None):
        from pydrake.multibody.tree import FixedOffsetFrame

        parent = body.body_frame() if body else plant.world_frame()
        return FixedOffsetFrame("upright" + ("_ball" if body else ""), parent, pose)

    def run(diagram, numbers, scalar, number):
        system = diagram.ToAutoDiffXd() if scalar else diagram
        plant = system.GetSubsystemByName("plant")
        context = system.CreateDefaultContext()
        mine = plant.GetMyMutableContextFromRoot(context)

        def seed(value, name):
            return AutoDiffXd(value, [1.0 if name == number else 0.0]) if scalar else value

        height, vx = seed(numbers[1], "height"), seed(numbers[2], "vx")
        state = [seed(0.0, ""), height] + ([seed(0.0, "")] if numbers[6] else [])
        state += [vx, seed(numbers[3], "")] + ([seed(0.0, "")] if numbers[6] else [])
        plant.SetPositionsAndVelocities(mine, np.array(state))
        simulator = Simulator_[AutoDiffXd](system, context) if scalar else Simulator(system, context)
        simulator.AdvanceTo(numbers[7])
        return plant.GetPositions(mine)[0]

    for problem, parameter, scene, number, exact in PROBLEMS:
        if scene == "bounce" or number == "mu":
            continue
        numbers = SCENES[scene]
        diagram, _ = build(numbers)
        _, forward = least(lambda: run(diagram, numbers, False, number), 3)
        value, both = least(lambda: float(run(diagram, numbers, True, number).derivatives()[0]), 3)
        row(problem, parameter, "Drake AutoDiff (discrete)", dt, value, exact, forward, both)


# --- nimble ---------------------------------------------------------------------------------------


def nimble_reverse():
    import nimblephysics as nimble
    import numpy as np

    dt = 1e-3

    def build(numbers):
        world = nimble.simulation.World()
        world.setGravity([0, -numbers[0], 0])
        world.setTimeStep(dt)
        ball = nimble.dynamics.Skeleton()
        if numbers[6]:
            joint, node = ball.createPlanarJointAndBodyNodePair()
            joint.setXYPlane()
        else:
            joint, node = ball.createTranslationalJoint2DAndBodyNodePair()
            joint.setXYPlane()
        node.setMass(1.0)
        node.setMomentOfInertia(0.125, 0.125, 0.125)
        shape = node.createShapeNode(nimble.dynamics.SphereShape(R))
        shape.createVisualAspect(), shape.createCollisionAspect()
        node.setFrictionCoeff(numbers[4]), node.setRestitutionCoeff(numbers[5])
        world.addSkeleton(ball)
        floor = nimble.dynamics.Skeleton()
        _, ground = floor.createWeldJointAndBodyNodePair()
        offset = nimble.math.Isometry3()
        offset.set_translation([0, -R - 0.5, 0])
        floor.getJoint(0).setTransformFromParentBodyNode(offset)
        shape = ground.createShapeNode(nimble.dynamics.BoxShape([100, 1, 100]))
        shape.createVisualAspect(), shape.createCollisionAspect()
        ground.setFrictionCoeff(numbers[4]), ground.setRestitutionCoeff(1.0)
        world.addSkeleton(floor)
        return world

    def run(numbers, number, coordinate, derive):
        world = build(numbers)
        n = world.getNumDofs()
        position, velocity = np.zeros(n), np.zeros(n)
        position[1] = numbers[1]
        velocity[0], velocity[1] = numbers[2], numbers[3]
        world.setState(np.concatenate([position, velocity]))
        seed = np.zeros(2 * n)
        seed[1 if number == "height" else n] = 1
        for _ in range(round(numbers[7] / dt)):
            if derive:
                snapshot = nimble.neural.forwardPass(world)
                seed = snapshot.getStateJacobian(world) @ seed
            else:
                world.step()
        return seed[coordinate] if derive else world.getState()[coordinate]

    for problem, parameter, scene, number, exact in PROBLEMS:
        if number == "mu":
            continue
        numbers, coordinate = SCENES[scene], 1 if scene == "bounce" else 0
        _, forward = least(lambda: run(numbers, number, coordinate, False), 3)
        value, both = least(lambda: float(run(numbers, number, coordinate, True)), 3)
        row(problem, parameter, "nimble (state Jacobians)", dt, value, exact, forward, both)


# --- Newton ---------------------------------------------------------------------------------------


def newton_reverse():
    import newton
    import numpy as np
    import warp as wp

    wp.config.quiet = True
    wp.init()
    dt = 1e-3
    for problem, parameter, scene, number, exact in PROBLEMS:
        if number == "mu":
            continue
        numbers = SCENES[scene]
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, -numbers[0]))
        config = newton.ModelBuilder.ShapeConfig(density=0.0, mu=numbers[4], ke=1e5, kd=1e2, kf=1e3,
                                                 restitution=numbers[5])
        body = builder.add_body(xform=wp.transform((0.0, 0.0, R + numbers[1]), wp.quat_identity()),
                                mass=1.0, inertia=wp.mat33(np.eye(3) * (0.125 if numbers[6] else 1e6)))
        builder.add_shape_sphere(body, radius=R, cfg=config)
        builder.add_ground_plane(cfg=config)
        with wp.ScopedDevice("cpu"):
            model = builder.finalize(requires_grad=True)
            solver = newton.solvers.SolverSemiImplicit(model)
            steps = round(numbers[7] / dt)
            states = [model.state(requires_grad=True) for _ in range(steps + 1)]
            control = model.control()

            def run(derive):
                start = states[0]
                q = start.body_q.numpy()
                v = start.body_qd.numpy()
                v[0, :3] = (numbers[2], 0, numbers[3])
                start.body_q.assign(q), start.body_qd.assign(v)
                tape = wp.Tape()
                with tape:
                    for k in range(steps):
                        states[k].clear_forces()
                        contacts = model.collide(states[k])
                        solver.step(states[k], states[k + 1], control, contacts, dt)
                if not derive:
                    return 0.0
                seed = np.zeros_like(q)
                seed[0, 2 if scene == "bounce" else 0] = 1
                last = wp.array(seed, dtype=wp.transform)
                tape.backward(grads={states[-1].body_q: last})
                value = (start.body_q.grad.numpy()[0, 2] if number == "height"
                         else start.body_qd.grad.numpy()[0, 0])
                tape.zero()
                return float(value)

            run(True)  # compiled
            _, forward = least(lambda: run(False), 3)
            value, both = least(lambda: run(True), 3)
        row(problem, parameter, "Newton semi-implicit reverse", dt, value, exact, forward, both)


ENGINES = {"mujoco": mujoco_differences, "mjx": mjx_reverse, "drake": drake_forward,
           "nimble": nimble_reverse, "newton": newton_reverse}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--carom", metavar="PATH", help="bench_gradient, for its rows in the same run")
    parser.add_argument("engine", nargs="*", help=", ".join(ENGINES))
    arguments = parser.parse_args()
    unknown = set(arguments.engine) - set(ENGINES)
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: known are {', '.join(ENGINES)}")
    print("part,scene,engine,what,dt,value,exact,error,seconds,over_forward,bytes", flush=True)
    if arguments.carom:
        for dt in ("0.0166666666666666", "0.001"):
            rows = subprocess.run([arguments.carom, "closed", dt], check=True, capture_output=True,
                                  text=True).stdout.splitlines()
            print("\n".join(rows[1:]), flush=True)
    for name in arguments.engine or ENGINES:
        try:
            ENGINES[name]()
        except ImportError as error:
            print(f"# {name}: not here ({error})", flush=True)
        except Exception as error:  # another engine's failure is a result of this bench
            print(f"# {name}: {type(error).__name__}: {str(error).splitlines()[0][:200]}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
