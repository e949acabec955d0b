"""From loads to new velocities and places: leapfrog, with the angular momentum kept in space.

Velocities belong to the middle of the steps. Free fall and torque-free angular momentum are
exact; the orientation turns by the angular velocity extrapolated to the middle of the step.
Numerical damping as in YADE: each component of the contact forces is diminished by `damping` times
its size where it drives the motion, and enlarged where it brakes it.
"""

import math
from typing import NamedTuple

import numpy as np

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.state import (
    CONTACT_DAMPING,
    DRAG,
    FORCE_WORK,
    GRAINS,
    KINETIC,
    NUMERICAL_DAMPING,
    POTENTIAL,
    STALE,
)
from mfopt.arrays import Array


class Field(NamedTuple):
    """What acts on grains besides contacts."""

    gravity: float  # [m/s2] along -z
    side_x: float  # [m/s2] gravity along x
    side_y: float  # [m/s2] along y
    damping: float
    damp_gravity: bool
    linear_drag: float  # [1/s] at scale 1
    quadratic_drag: float  # [1/m] at scale 1
    forces: Array  # (m, 9) lower and upper corner of a box [m], acceleration [m/s2]
    exit_z: float  # [m]


@compiled
def integrate(state, shape, field, time, dt, kick, viscous, measure):  # type: ignore[no-untyped-def]
    """Move all grains and their spheres from `time` to `time + dt`; loads are used up.

    Args:
        state: see there.
        shape: (k, 4) centre and radius of each sphere in the grain's frame, at scale 1 [m].
        field: see there.
        time, dt: [s].
        kick: share of the step that the loads act for: 1/2 in the first, 1 in all others.
        viscous: whether contacts are damped.
        measure: whether to sum kinetic and potential energy at `time` in `budget`.
    """
    bodies, spheres, budget = state.bodies, state.spheres, state.budget
    kin, mom, inertia = bodies.kinematics, bodies.momentum, bodies.inertia
    inverse = bodies.inverse
    turn, quat = bodies.rotation, bodies.quaternion
    place, listed = spheres.place, spheres.listed
    k = shape.shape[0]
    h = kick * dt
    damped = absorbed = dragged = worked = kinetic = potential = 0.0
    stale = False
    tilted = field.side_x != 0.0 or field.side_y != 0.0
    passed = time + dt - state.drift[3]
    drift_x, drift_y, drift_z = (
        passed * state.drift[0],
        passed * state.drift[1],
        passed * state.drift[2],
    )
    for g in range(np.uint64(state.counts[GRAINS])):
        mass, light = inertia[g, 0], inverse[g, 0]
        vx, vy, vz = kin[g, 3], kin[g, 4], kin[g, 5]
        ax, ay, az = kin[g, 9] * light, kin[g, 10] * light, kin[g, 11] * light
        tx, ty, tz = kin[g, 12], kin[g, 13], kin[g, 14]
        weight, side_x, side_y = -field.gravity, field.side_x, field.side_y
        ex = ey = ez = qx = qy = qz = 0.0  # what damping adds to acceleration and torque
        if field.damping > 0.0:
            if field.damp_gravity:
                az += weight
                if tilted:
                    ax, ay = ax + side_x, ay + side_y
            ex, ey, ez = ax, ay, az
            ax = brake(ax, vx + 0.5 * h * ax, field.damping)
            ay = brake(ay, vy + 0.5 * h * ay, field.damping)
            az = brake(az, vz + 0.5 * h * az, field.damping)
            ex, ey, ez = ax - ex, ay - ey, az - ez
            if field.damp_gravity:
                weight = side_x = side_y = 0.0
            qx, qy, qz = tx, ty, tz
            tx = brake(tx, kin[g, 6], field.damping)
            ty = brake(ty, kin[g, 7], field.damping)
            tz = brake(tz, kin[g, 8], field.damping)
            qx, qy, qz = tx - qx, ty - qy, tz - qz
        az += weight
        if tilted:
            ax, ay = ax + side_x, ay + side_y
        rate = 0.0
        if field.linear_drag > 0.0 or field.quadratic_drag > 0.0:
            speed = math.sqrt(vx * vx + vy * vy + vz * vz)
            scale = bodies.scale[g]
            rate = field.linear_drag / (scale * scale) + field.quadratic_drag * speed / scale
            ax, ay, az = ax - rate * vx, ay - rate * vy, az - rate * vz
        px = py = pz = 0.0
        for f in range(field.forces.shape[0]):
            box = field.forces[f]
            if (
                box[0] <= kin[g, 0] <= box[3]
                and box[1] <= kin[g, 1] <= box[4]
                and box[2] <= kin[g, 2] <= box[5]
            ):
                px, py, pz = px + box[6], py + box[7], pz + box[8]
        ax, ay, az = ax + px, ay + py, az + pz
        nvx, nvy, nvz = vx + h * ax, vy + h * ay, vz + h * az
        lx, ly, lz = mom[g, 0] + h * tx, mom[g, 1] + h * ty, mom[g, 2] + h * tz
        # Into the frame of the grain, and there to the middle of the step: Euler's equations.
        m = turn[g]
        bx = m[0] * lx + m[3] * ly + m[6] * lz
        by = m[1] * lx + m[4] * ly + m[7] * lz
        bz = m[2] * lx + m[5] * ly + m[8] * lz
        i1, i2, i3 = inverse[g, 1], inverse[g, 2], inverse[g, 3]
        ox, oy, oz = bx * i1, by * i2, bz * i3
        cx = ox + 0.5 * dt * (by * oz - bz * oy) * i1
        cy = oy + 0.5 * dt * (bz * ox - bx * oz) * i2
        cz = oz + 0.5 * dt * (bx * oy - by * ox) * i3
        # Work is force times the velocity at `time`, midway between the old and the new one.
        mx, my, mz = 0.5 * (vx + nvx), 0.5 * (vy + nvy), 0.5 * (vz + nvz)
        dragged += mass * h * rate * (vx * mx + vy * my + vz * mz)
        worked += mass * h * (px * mx + py * my + pz * mz)
        if field.damping > 0.0 or viscous:
            rx, ry, rz = spin_at(
                m, inverse[g], lx - 0.5 * h * tx, ly - 0.5 * h * ty, lz - 0.5 * h * tz
            )
            damped -= mass * h * (ex * mx + ey * my + ez * mz) + h * (qx * rx + qy * ry + qz * rz)
            if viscous:
                part = bodies.viscous[g]
                absorbed -= h * (part[0] * mx + part[1] * my + part[2] * mz)
                absorbed -= h * (part[3] * rx + part[4] * ry + part[5] * rz)
                for c in range(6):
                    part[c] = 0.0
        if measure:
            if kick < 1.0:
                mx, my, mz = vx, vy, vz
            kinetic += 0.5 * mass * (mx * mx + my * my + mz * mz)
            # The angular momentum at `time` lies half a torque behind.
            lx0, ly0, lz0 = lx - 0.5 * h * tx, ly - 0.5 * h * ty, lz - 0.5 * h * tz
            if kick < 1.0:
                lx0, ly0, lz0 = mom[g, 0], mom[g, 1], mom[g, 2]
            ux = m[0] * lx0 + m[3] * ly0 + m[6] * lz0
            uy = m[1] * lx0 + m[4] * ly0 + m[7] * lz0
            uz = m[2] * lx0 + m[5] * ly0 + m[8] * lz0
            kinetic += 0.5 * (ux * ux * i1 + uy * uy * i2 + uz * uz * i3)
            potential += mass * field.gravity * kin[g, 2]
            if tilted:
                potential -= mass * (field.side_x * kin[g, 0] + field.side_y * kin[g, 1])
        mom[g, 0], mom[g, 1], mom[g, 2] = lx, ly, lz
        kin[g, 3], kin[g, 4], kin[g, 5] = nvx, nvy, nvz
        kin[g, 6] = m[0] * cx + m[1] * cy + m[2] * cz
        kin[g, 7] = m[3] * cx + m[4] * cy + m[5] * cz
        kin[g, 8] = m[6] * cx + m[7] * cy + m[8] * cz
        # q <- q (1, c dt / 2), normalised: right to third order.
        hx, hy, hz = 0.5 * dt * cx, 0.5 * dt * cy, 0.5 * dt * cz
        w, x, y, z = quat[g, 0], quat[g, 1], quat[g, 2], quat[g, 3]
        nw = w - x * hx - y * hy - z * hz
        nx = x + w * hx + y * hz - z * hy
        ny = y + w * hy + z * hx - x * hz
        nz = z + w * hz + x * hy - y * hx
        norm = 1.0 / math.sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
        w, x, y, z = nw * norm, nx * norm, ny * norm, nz * norm
        quat[g, 0], quat[g, 1], quat[g, 2], quat[g, 3] = w, x, y, z
        m[0], m[1], m[2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        m[3], m[4], m[5] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        m[6], m[7], m[8] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
        before = kin[g, 2]
        px, py, pz = kin[g, 0] + dt * nvx, kin[g, 1] + dt * nvy, before + dt * nvz
        kin[g, 0], kin[g, 1], kin[g, 2] = px, py, pz
        for c in range(6):
            kin[g, 9 + c] = 0.0
        scale = bodies.scale[g]
        first = g * np.uint64(k)
        for c in range(np.uint64(k)):
            sx, sy, sz = scale * shape[c, 0], scale * shape[c, 1], scale * shape[c, 2]
            i = first + c
            sphere_x = px + m[0] * sx + m[1] * sy + m[2] * sz
            sphere_y = py + m[3] * sx + m[4] * sy + m[5] * sz
            sphere_z = pz + m[6] * sx + m[7] * sy + m[8] * sz
            place[i, 0], place[i, 1], place[i, 2] = sphere_x, sphere_y, sphere_z
            dx = sphere_x - listed[i, 0] - drift_x
            dy = sphere_y - listed[i, 1] - drift_y
            dz = sphere_z - listed[i, 2] - drift_z
            stale = stale or dx * dx + dy * dy + dz * dz > listed[i, 3]
        if pz < field.exit_z and not bodies.left[g]:
            share = (before - field.exit_z) / (before - pz) if before > field.exit_z else 0.0
            leave(state, g, time + share * dt, (1.0 - share) * dt)
    budget[NUMERICAL_DAMPING] += damped
    budget[CONTACT_DAMPING] += absorbed
    budget[DRAG] += dragged
    budget[FORCE_WORK] += worked
    if measure:
        budget[KINETIC] += kinetic
        budget[POTENTIAL] += potential
    if stale:
        state.counts[STALE] = 1


@inlined
def spin_at(m, inverse, lx, ly, lz):  # type: ignore[no-untyped-def]
    """Angular velocity that belongs to an angular momentum, both in space [rad/s]."""
    x = inverse[1] * (m[0] * lx + m[3] * ly + m[6] * lz)
    y = inverse[2] * (m[1] * lx + m[4] * ly + m[7] * lz)
    z = inverse[3] * (m[2] * lx + m[5] * ly + m[8] * lz)
    return (
        m[0] * x + m[1] * y + m[2] * z,
        m[3] * x + m[4] * y + m[5] * z,
        m[6] * x + m[7] * y + m[8] * z,
    )


@inlined
def brake(force, velocity, damping):  # type: ignore[no-untyped-def]
    """Cundall's numerical damping of one component."""
    return force * (1.0 - math.copysign(damping, force * velocity))


@compiled
def leave(state, g, time, past):  # type: ignore[no-untyped-def]
    """Keep when and how grain g left, `past` [s] ago; it is taken out later."""
    bodies, exits = state.bodies, state.exits
    n = bodies.number[g]
    exits.time[n] = time
    for c in range(3):  # back to where it was then
        exits.state[n, c] = bodies.kinematics[g, c] - past * bodies.kinematics[g, 3 + c]
    for c in range(3, 9):
        exits.state[n, c] = bodies.kinematics[g, c]
    for c in range(4):
        exits.state[n, 9 + c] = bodies.quaternion[g, c]
    bodies.left[g] = True
