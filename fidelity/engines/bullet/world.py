"""A setup as PyBullet bodies: scaled units, friction, restitution, walls.

Bullet's contact margins are made for bodies of about 0.1 to 10 length units, and its solver
for masses near 1; so lengths are multiplied by `LENGTH_SCALE`, the mass of a grain of scale 1
is 1, and times are kept. Contact with rigid bodies depends on ratios of masses only.

Source: E. Coumans, Bullet 2.83 Physics SDK Manual (units, mesh shapes, solver parameters).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fidelity.engine import (
    Grain,
    Material,
    Physics,
    Setup,
    Wall,
    WallMotion,
    sizes,
    smallest_radius,
)
from fidelity.engines.wall_motion import angle_at, shift_at
from mfopt.arrays import Array, IntArray

LENGTH_SCALE = 10.0  # Bullet length units per metre

OVERLAP_CORRECTION = 0.2  # share of an overlap corrected per step; 0.5 makes a pile boil

# [Pa] A moving wall pushes with this times the smallest radius per overlap. A grain pinched
# between its rim and a fixed edge then goes past the rim; between two rigid ones it was pressed
# into or through the fixed wall in 4 of 7 dosing runs of 300 grains; so, in none of 10.
# A portion pushed at 50 m/s2 weighs on it with p = 5 kPa: 4 p r^2 a sphere, 0.2 radii deep.
MOVING_WALL_MODULUS = 1e5

# [m/s] Slower contacts do not bounce, or a pile would never rest: five steps' fall at 1 ms.
# Contacts are made one step of this speed ahead: Bullet takes gap / step off a bounce, so that
# a wider reach (its default is 2 mm of ours) swallows bounces.
RESTING_SPEED = 0.05


@dataclass(frozen=True, slots=True)
class World:
    """Bodies of one simulation by their numbers in PyBullet."""

    client: int
    grains: tuple[int, ...]
    moving_walls: tuple[tuple[int, WallMotion], ...]


def restitution(physics: Physics) -> float:
    """Coefficient of restitution: the one given, or that which matches YADE's numerical damping.

    A linear spring whose force is (1 + d) F on the way in and (1 - d) F on the way out
    returns the speed times e = sqrt((1 - d) / (1 + d)).

    Source: V. Smilauer et al., YADE documentation, "Numerical damping" (Cundall).
    """
    if physics.restitution is not None:
        return physics.restitution
    return math.sqrt((1.0 - physics.damping) / (1.0 + physics.damping))


def bullet_restitution(physics: Physics) -> float:
    """The value for Bullet with which bounces return `restitution` on average.

    Its correction adds overlap / step times `OVERLAP_CORRECTION` to a bounce. A sphere of speed
    v is found anywhere between no overlap and v times the step, so v / 2 times that on average.
    """
    return max(0.0, restitution(physics) - OVERLAP_CORRECTION / 2.0)


def fall_acceleration(physics: Physics) -> float:
    """Acceleration of a falling grain [m/s2]; damping slows it only where it acts on gravity."""
    return physics.gravity * ((1.0 - physics.damping) if physics.damp_gravity else 1.0)


def friction_factors(grain: Material, wall: Material) -> tuple[float, float]:
    """Bullet's friction values of grain and wall; it multiplies the two of a pair.

    They give mu = tan(friction angle) between grains, and between grain and wall the tangent
    of the smaller angle, as in YADE.
    """
    between_grains = math.tan(grain.friction_angle)
    at_wall = math.tan(min(grain.friction_angle, wall.friction_angle))
    of_grain = math.sqrt(between_grains)
    return of_grain, at_wall / of_grain if of_grain > 0.0 else 0.0


def build(p: Any, setup: Setup, *, timestep: float, iterations: int) -> World:
    """Make the bodies of `setup` in a new PyBullet world; `p` is the pybullet module."""
    client = p.connect(p.DIRECT)
    p.setPhysicsEngineParameter(
        fixedTimeStep=timestep,
        numSubSteps=0,
        numSolverIterations=iterations,
        deterministicOverlappingPairs=1,  # the order of contacts, hence a bitwise repeat
        contactBreakingThreshold=RESTING_SPEED * timestep * LENGTH_SCALE,
        restitutionVelocityThreshold=RESTING_SPEED * LENGTH_SCALE,
        # Overlaps are pushed out by contact velocities. Split impulses (positions only) left
        # 300 grains at rest with 0.23 radii of overlap instead of 0.05.
        useSplitImpulse=0,
        contactERP=OVERLAP_CORRECTION,
    )
    p.setGravity(0.0, 0.0, -fall_acceleration(setup.physics) * LENGTH_SCALE)
    bounce = math.sqrt(bullet_restitution(setup.physics))  # Bullet multiplies these too
    moving = []
    for wall in setup.walls:
        _, friction = friction_factors(setup.grain_material, wall.material)
        body = _add_wall(p, wall, friction=friction, bounce=bounce)
        if wall.motion is not None:
            _soften(p, body, setup)
            moving.append((body, wall.motion))
    grains = _add_grains(p, setup, bounce=bounce, timestep=timestep)
    return World(client, grains, tuple(moving))


def _add_wall(p: Any, wall: Wall, *, friction: float, bounce: float) -> int:
    shape = p.createCollisionShape(
        p.GEOM_MESH,
        vertices=(wall.vertices * LENGTH_SCALE).tolist(),
        indices=wall.triangles.ravel().tolist(),
        flags=p.GEOM_FORCE_CONCAVE_TRIMESH,
    )
    # Only Bullet's multi-body, not its rigid body, hands a wall's velocity to the contacts.
    body = p.createMultiBody(0.0, shape, useMaximalCoordinates=int(wall.motion is None))
    p.changeDynamics(body, -1, lateralFriction=friction, restitution=bounce)
    return int(body)


def _soften(p: Any, body: int, setup: Setup) -> None:
    # A grain's mass is 1, so this is its squared frequency on the wall [1/s2]; damped critically.
    stiffness = MOVING_WALL_MODULUS * smallest_radius(setup) / setup.grain.mass
    damping = 2.0 * math.sqrt(stiffness)
    p.changeDynamics(body, -1, contactStiffness=stiffness, contactDamping=damping)


def _add_grains(p: Any, setup: Setup, *, bounce: float, timestep: float) -> tuple[int, ...]:
    friction, _ = friction_factors(setup.grain_material, setup.grain_material)
    inertia = setup.grain.inertia / setup.grain.mass * LENGTH_SCALE**2
    velocities, spins = start(setup)
    # Bullet's velocities belong to the middle of the step before (it moves by the new
    # velocity): with this start the positions of free fall are exact.
    velocities[:, 2] += 0.5 * timestep * fall_acceleration(setup.physics)
    shapes: dict[float, int] = {}
    bodies = []
    for i, scale in enumerate(sizes(setup.packing).tolist()):
        if scale not in shapes:
            shapes[scale] = _grain_shape(p, setup.grain, scale)
        w, x, y, z = setup.packing.orientations[i].tolist()
        place = (setup.packing.positions[i] * LENGTH_SCALE).tolist()
        body = p.createMultiBody(
            1.0, shapes[scale], -1, place, [x, y, z, w], useMaximalCoordinates=1
        )
        p.changeDynamics(
            body,
            -1,
            mass=scale**3,
            localInertiaDiagonal=(scale**5 * inertia).tolist(),
            lateralFriction=friction,
            restitution=bounce,
            linearDamping=0.0,  # Bullet's default of 0.04 slows free fall
            angularDamping=0.0,
            activationState=p.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        p.resetBaseVelocity(body, (velocities[i] * LENGTH_SCALE).tolist(), spins[i].tolist())
        bodies.append(int(body))
    return tuple(bodies)


def _grain_shape(p: Any, grain: Grain, scale: float) -> int:
    return int(
        p.createCollisionShapeArray(
            shapeTypes=[p.GEOM_SPHERE] * grain.radii.size,
            radii=(scale * grain.radii * LENGTH_SCALE).tolist(),
            collisionFramePositions=(scale * grain.offsets * LENGTH_SCALE).tolist(),
        )
    )


def start(setup: Setup) -> tuple[Array, Array]:
    """Velocities (n, 3) [m/s] and angular velocities (n, 3) [rad/s] at time 0, copies."""
    rest = np.zeros_like(setup.packing.positions)
    given = (setup.velocities, setup.angular_velocities)
    first, second = (np.array(rest if values is None else values) for values in given)
    return first, second


def place_walls(p: Any, world: World, time: float, dt: float) -> None:
    """Put the moving walls where they are at `time` [s], moving to where they are `dt` later."""
    origin = np.zeros((1, 3))  # of the body's frame; at time 0 it is that of space
    for body, motion in world.moving_walls:
        now, then = (shift_at(motion, origin, t)[0] for t in (time, time + dt))
        angle, next_angle = angle_at(motion, time), angle_at(motion, time + dt)
        axis = np.asarray(motion.axis)
        turn = [*(math.sin(angle / 2.0) * axis).tolist(), math.cos(angle / 2.0)]
        p.resetBasePositionAndOrientation(body, (now * LENGTH_SCALE).tolist(), turn)
        velocity, spin = (then - now) / dt * LENGTH_SCALE, (next_angle - angle) / dt * axis
        p.resetBaseVelocity(body, velocity.tolist(), spin.tolist())


def read_poses(p: Any, bodies: list[int]) -> tuple[Array, Array]:
    """Positions (n, 3) [m] and orientations (n, 4) w, x, y, z of bodies."""
    poses = [p.getBasePositionAndOrientation(body) for body in bodies]
    positions = np.array([pose[0] for pose in poses]).reshape(-1, 3) / LENGTH_SCALE
    orientations = np.array([pose[1] for pose in poses]).reshape(-1, 4)
    return positions, orientations[:, [3, 0, 1, 2]]


def read_heights(p: Any, bodies: list[int]) -> Array:
    """Heights (n,) [m] of bodies."""
    heights = [p.getBasePositionAndOrientation(body)[0][2] for body in bodies]
    return np.array(heights) / LENGTH_SCALE


def read_velocities(p: Any, bodies: list[int]) -> tuple[Array, Array]:
    """Velocities (n, 3) [m/s] and angular velocities (n, 3) [rad/s] of bodies."""
    pairs = np.array([p.getBaseVelocity(body) for body in bodies]).reshape(-1, 2, 3)
    return pairs[:, 0] / LENGTH_SCALE, pairs[:, 1]


def read_overlaps(p: Any) -> tuple[Array, IntArray]:
    """Overlap (c,) [m] and the two bodies (c, 2) of contacts; negative is a gap."""
    contacts = p.getContactPoints() or ()
    bodies, distance = (1, 2), 8  # indices in a contact as PyBullet reports it
    overlaps = np.array([-contact[distance] for contact in contacts]) / LENGTH_SCALE
    pairs = [[contact[i] for i in bodies] for contact in contacts]
    return overlaps, np.array(pairs, dtype=np.int64).reshape(-1, 2)
