"""The walls' prescribed motion, and the way from space to a body and back."""

import math
from collections.abc import Sequence

import numpy as np

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.state import Moving
from fidelity.dem.surface import Body, Surface
from mfopt.arrays import IntArray


def new_moving(bodies: Sequence[Body], surface: Surface) -> Moving:
    """All bodies at time 0."""
    b = len(bodies)
    pivot, axis, reach = np.zeros((b, 3)), np.zeros((b, 3)), np.zeros(b)
    times, samples = [], []
    first: IntArray = np.zeros(b + 1, dtype=np.int64)
    t = surface.triangles
    corners = np.stack([t[:, :3], t[:, :3] + t[:, 3:6], t[:, :3] + t[:, 6:9]], axis=1)
    for i, (motion, _) in enumerate(bodies):
        first[i + 1] = first[i]
        if motion is None:
            times.append(np.zeros(1))
            samples.append(np.zeros((1, 4)))
            first[i + 1] += 1
            continue
        pivot[i], axis[i] = motion.pivot, motion.axis
        mine = corners[surface.body == i].reshape(-1, 3)
        if motion.angles is not None:
            reach[i] = np.linalg.norm(mine - pivot[i], axis=1).max(initial=0.0)
        angles = np.zeros(len(motion.times)) if motion.angles is None else motion.angles
        times.append(motion.times)
        samples.append(np.column_stack([motion.displacements, angles]))
        first[i + 1] += len(motion.times)
    return Moving(
        place=np.zeros((b, 3)),
        rotation=np.tile(np.eye(3).ravel(), (b, 1)),
        velocity=np.zeros((b, 3)),
        spin=np.zeros((b, 3)),
        mean_velocity=np.zeros((b, 3)),
        mean_spin=np.zeros((b, 3)),
        angle=np.zeros(b),
        listed=np.zeros((b, 5)),
        pivot=pivot,
        axis=axis,
        reach=reach,
        first=first,
        until=np.array([body.until for body in bodies]),
        times=np.concatenate(times).astype(np.float64),
        samples=np.concatenate(samples),
    )


@compiled
def sample(moving, b, time):  # type: ignore[no-untyped-def]
    """Displacement (3) [m] and angle [rad] of body b at `time`."""
    first, last = moving.first[b], moving.first[b + 1] - 1
    times, samples = moving.times, moving.samples
    if time <= times[first]:
        return samples[first, 0], samples[first, 1], samples[first, 2], samples[first, 3]
    if time >= times[last]:
        return samples[last, 0], samples[last, 1], samples[last, 2], samples[last, 3]
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        if times[middle] <= time:
            low = middle
        else:
            high = middle
    u = (time - times[low]) / (times[high] - times[low])
    a, b_ = samples[low], samples[high]
    return (
        a[0] + u * (b_[0] - a[0]),
        a[1] + u * (b_[1] - a[1]),
        a[2] + u * (b_[2] - a[2]),
        a[3] + u * (b_[3] - a[3]),
    )


@compiled
def place_bodies(moving, time, dt):  # type: ignore[no-untyped-def]
    """Put all bodies where they are at `time`.

    Their velocity is that of the step before it, as the grains' is; their work is the force times
    the mean velocity of the steps before and after.
    """
    for b in range(1, moving.place.shape[0]):
        x, y, z, angle = sample(moving, b, time)
        x0, y0, z0, angle0 = sample(moving, b, time - dt)
        x1, y1, z1, angle1 = sample(moving, b, time + dt)
        moving.place[b, 0], moving.place[b, 1], moving.place[b, 2] = x, y, z
        moving.velocity[b, 0] = (x - x0) / dt
        moving.velocity[b, 1] = (y - y0) / dt
        moving.velocity[b, 2] = (z - z0) / dt
        rate = (angle - angle0) / dt
        ax, ay, az = moving.axis[b, 0], moving.axis[b, 1], moving.axis[b, 2]
        moving.spin[b, 0], moving.spin[b, 1], moving.spin[b, 2] = rate * ax, rate * ay, rate * az
        rate = 0.5 * (angle1 - angle0) / dt
        moving.mean_spin[b, 0], moving.mean_spin[b, 1] = rate * ax, rate * ay
        moving.mean_spin[b, 2] = rate * az
        moving.mean_velocity[b, 0] = 0.5 * (x1 - x0) / dt
        moving.mean_velocity[b, 1] = 0.5 * (y1 - y0) / dt
        moving.mean_velocity[b, 2] = 0.5 * (z1 - z0) / dt
        moving.angle[b] = angle
        c, s = math.cos(angle), math.sin(angle)
        d = 1.0 - c
        m = moving.rotation
        m[b, 0], m[b, 1], m[b, 2] = c + ax * ax * d, ax * ay * d - az * s, ax * az * d + ay * s
        m[b, 3], m[b, 4], m[b, 5] = ay * ax * d + az * s, c + ay * ay * d, ay * az * d - ax * s
        m[b, 6], m[b, 7], m[b, 8] = az * ax * d - ay * s, az * ay * d + ax * s, c + az * az * d


@compiled
def moved_since_listed(moving, b, drift, time):  # type: ignore[no-untyped-def]
    """How far any point of body b may have moved against the drift since it was listed [m]."""
    passed = time - drift[3]
    dx = moving.place[b, 0] - moving.listed[b, 0] - passed * drift[0]
    dy = moving.place[b, 1] - moving.listed[b, 1] - passed * drift[1]
    dz = moving.place[b, 2] - moving.listed[b, 2] - passed * drift[2]
    turned = abs(moving.angle[b] - moving.listed[b, 3])
    return math.sqrt(dx * dx + dy * dy + dz * dz) + turned * moving.reach[b]


@inlined
def to_body(moving, b, x, y, z):  # type: ignore[no-untyped-def]
    """A point of space where the body was at time 0."""
    if b == 0:
        return x, y, z
    px, py, pz = moving.pivot[b, 0], moving.pivot[b, 1], moving.pivot[b, 2]
    x = x - moving.place[b, 0]
    y = y - moving.place[b, 1]
    z = z - moving.place[b, 2]
    if moving.angle[b] == 0.0:
        return x, y, z
    x, y, z = x - px, y - py, z - pz
    m = moving.rotation
    return (
        px + m[b, 0] * x + m[b, 3] * y + m[b, 6] * z,
        py + m[b, 1] * x + m[b, 4] * y + m[b, 7] * z,
        pz + m[b, 2] * x + m[b, 5] * y + m[b, 8] * z,
    )


@inlined
def to_space(moving, b, x, y, z):  # type: ignore[no-untyped-def]
    """A direction on the body as it is now in space."""
    if moving.angle[b] == 0.0:
        return x, y, z
    m = moving.rotation
    return (
        m[b, 0] * x + m[b, 1] * y + m[b, 2] * z,
        m[b, 3] * x + m[b, 4] * y + m[b, 5] * z,
        m[b, 6] * x + m[b, 7] * y + m[b, 8] * z,
    )


@inlined
def way_on_body(moving, b, x, y, z, vx, vy, vz, dt):  # type: ignore[no-untyped-def]
    """Way that a point of space went on the body in the last step, its velocity given [m]."""
    ox, oy, oz = moving.spin[b, 0], moving.spin[b, 1], moving.spin[b, 2]
    bx = x - moving.pivot[b, 0] - moving.place[b, 0]
    by = y - moving.pivot[b, 1] - moving.place[b, 1]
    bz = z - moving.pivot[b, 2] - moving.place[b, 2]
    ux = dt * (vx - moving.velocity[b, 0] - oy * bz + oz * by)
    uy = dt * (vy - moving.velocity[b, 1] - oz * bx + ox * bz)
    uz = dt * (vz - moving.velocity[b, 2] - ox * by + oy * bx)
    if moving.angle[b] == 0.0:
        return ux, uy, uz
    m = moving.rotation
    return (
        m[b, 0] * ux + m[b, 3] * uy + m[b, 6] * uz,
        m[b, 1] * ux + m[b, 4] * uy + m[b, 7] * uz,
        m[b, 2] * ux + m[b, 5] * uy + m[b, 8] * uz,
    )
