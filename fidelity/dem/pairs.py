"""Forces between grains."""

import math

import numpy as np

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.law import contact_force, slide, spring_loss, turn_into_plane
from fidelity.dem.state import BLOCK, ELASTIC, OVERLAP, PAIRS, SIDE, SLIP, TOUCHING


@compiled
def pair_forces(state, pairs, touching, law, pair, dt, measure):  # type: ignore[no-untyped-def]
    """Add the forces and torques between all touching spheres of different grains.

    Args:
        state, pairs, touching: see `state`; loads and histories are changed.
        law, pair: see `law`.
        dt: [s].
        measure: whether to sum the elastic energy in `budget`, too.
    """
    bodies, place, owner = state.bodies, state.spheres.place, state.spheres.owner
    kin = bodies.kinematics
    first, other = pairs.first, pairs.other
    slipped = elastic = deepest = 0.0
    close, listed = pairs.close, np.uint64(state.counts[PAIRS])
    one, side = np.uint64(1), np.uint64(state.counts[SIDE])
    new, old_pair = touching.pair[one - side], touching.pair[side]
    force, old_force = touching.force[one - side], touching.force[side]
    moment, old_moment = touching.moment[one - side], touching.moment[side]
    o, o_end = np.uint64(0), np.uint64(state.counts[TOUCHING])
    count = np.uint64(0)
    block, end = np.uint64(0), np.uint64(0)
    while end < listed:
        # Part by part, so that the second look at a sphere finds it in the cache.
        block, end = end, min(listed, end + np.uint64(BLOCK))
        # Without a branch, as nobody can guess which ones touch; in two loops, as the first is
        # done several at a time.
        for p in range(block, end):
            i, j = first[p], other[p]
            dx = place[i, 0] - place[j, 0]
            dy = place[i, 1] - place[j, 1]
            dz = place[i, 2] - place[j, 2]
            both = place[i, 3] + place[j, 3]
            close[p - block] = dx * dx + dy * dy + dz * dz < both * both
        q_begin = count
        for p in range(block, end):
            new[count] = p
            count += close[p - block]
        for q in range(q_begin, count):
            p = new[q]
            while o < o_end and old_pair[o] < p:
                o += one
            old = o < o_end and old_pair[o] == p
            i, j = first[p], other[p]
            g, h = owner[i], owner[j]
            xi, yi, zi, ri, rj = place[i, 0], place[i, 1], place[i, 2], place[i, 3], place[j, 3]
            nx, ny, nz = xi - place[j, 0], yi - place[j, 1], zi - place[j, 2]
            distance = math.sqrt(nx * nx + ny * ny + nz * nz)
            inverse = 1.0 / max(distance, 1e-30)
            nx, ny, nz = nx * inverse, ny * inverse, nz * inverse
            overlap = ri + rj - distance
            deepest = max(deepest, overlap)
            arm = ri - 0.5 * overlap
            cx, cy, cz = xi - arm * nx, yi - arm * ny, zi - arm * nz
            ax, ay, az = cx - kin[g, 0], cy - kin[g, 1], cz - kin[g, 2]
            bx, by, bz = cx - kin[h, 0], cy - kin[h, 1], cz - kin[h, 2]
            wx, wy, wz = kin[g, 6], kin[g, 7], kin[g, 8]
            ox, oy, oz = kin[h, 6], kin[h, 7], kin[h, 8]
            ux = kin[g, 3] + wy * az - wz * ay - kin[h, 3] - oy * bz + oz * by
            uy = kin[g, 4] + wz * ax - wx * az - kin[h, 4] - oz * bx + ox * bz
            uz = kin[g, 5] + wx * ay - wy * ax - kin[h, 5] - ox * by + oy * bx
            sx = sy = sz = 0.0
            if old:
                sx, sy, sz = old_force[o, 0], old_force[o, 1], old_force[o, 2]
            twist = 0.5 * dt * ((wx + ox) * nx + (wy + oy) * ny + (wz + oz) * nz)
            inverse_mass = 1.0
            if law.zeta > 0.0:
                inverse_mass = inverse_contact_mass(
                    bodies, g, ax, ay, az, nx, ny, nz
                ) + inverse_contact_mass(bodies, h, bx, by, bz, nx, ny, nz)
            radius = ri * rj / (ri + rj)
            fx, fy, fz, sx, sy, sz, press, kn, kt, grown, slip, vx, vy, vz = contact_force(
                law, pair, radius, 1.0, overlap, nx, ny, nz, ux, uy, uz, sx, sy, sz,
                twist, inverse_mass, dt,
            )  # fmt: skip
            force[q, 0], force[q, 1], force[q, 2] = sx, sy, sz
            slipped += slip
            if measure:
                elastic += stored(law.hertz, kn, kt, overlap, sx, sy, sz)
                if law.adhesion > 0.0:
                    elastic -= 2.0 * math.pi * law.adhesion * radius * overlap
            tx, ty, tz = ay * fz - az * fy, az * fx - ax * fz, ax * fy - ay * fx
            qx, qy, qz = by * fz - bz * fy, bz * fx - bx * fz, bx * fy - by * fx
            if law.rolling > 0.0:
                mx = my = mz = 0.0
                if old:
                    mx, my, mz = old_moment[o, 0], old_moment[o, 1], old_moment[o, 2]
                mx, my, mz, slip, kr = rolling_moment(
                    law.rolling, law.rolling_spring, radius, press, kt, grown, nx, ny, nz,
                    wx - ox, wy - oy, wz - oz, mx, my, mz, twist, dt,
                )  # fmt: skip
                moment[q, 0], moment[q, 1], moment[q, 2] = mx, my, mz
                slipped += slip
                if measure and kr > 0.0:
                    elastic += 0.5 * (mx * mx + my * my + mz * mz) / kr
                tx, ty, tz = tx + mx, ty + my, tz + mz
                qx, qy, qz = qx + mx, qy + my, qz + mz
            if law.zeta > 0.0:
                add_viscous(bodies.viscous, g, 1.0, ax, ay, az, vx, vy, vz)
                add_viscous(bodies.viscous, h, -1.0, bx, by, bz, vx, vy, vz)
            kin[g, 9] += fx
            kin[g, 10] += fy
            kin[g, 11] += fz
            kin[g, 12] += tx
            kin[g, 13] += ty
            kin[g, 14] += tz
            kin[h, 9] -= fx
            kin[h, 10] -= fy
            kin[h, 11] -= fz
            kin[h, 12] -= qx
            kin[h, 13] -= qy
            kin[h, 14] -= qz
    state.counts[TOUCHING], state.counts[SIDE] = count, 1 - state.counts[SIDE]
    budget = state.budget
    budget[SLIP] += slipped
    budget[OVERLAP] = max(budget[OVERLAP], deepest)
    if measure:
        budget[ELASTIC] += elastic


@inlined
def add_viscous(viscous, g, sign, ax, ay, az, vx, vy, vz):  # type: ignore[no-untyped-def]
    """Note the viscous part v of a force on grain g at the arm a from its centre."""
    viscous[g, 0] += sign * vx
    viscous[g, 1] += sign * vy
    viscous[g, 2] += sign * vz
    viscous[g, 3] += sign * (ay * vz - az * vy)
    viscous[g, 4] += sign * (az * vx - ax * vz)
    viscous[g, 5] += sign * (ax * vy - ay * vx)


@compiled
def inverse_contact_mass(bodies, g, ax, ay, az, nx, ny, nz):  # type: ignore[no-untyped-def]
    """1 / mass [1/kg] of grain g that resists a push along n at the arm a from its centre."""
    cx, cy, cz = ay * nz - az * ny, az * nx - ax * nz, ax * ny - ay * nx
    turn, inverse = bodies.rotation, bodies.inverse
    bx = turn[g, 0] * cx + turn[g, 3] * cy + turn[g, 6] * cz
    by = turn[g, 1] * cx + turn[g, 4] * cy + turn[g, 7] * cz
    bz = turn[g, 2] * cx + turn[g, 5] * cy + turn[g, 8] * cz
    return (
        inverse[g, 0] + bx * bx * inverse[g, 1] + by * by * inverse[g, 2] + bz * bz * inverse[g, 3]
    )


@compiled
def stored(hertz, kn, kt, overlap, sx, sy, sz):  # type: ignore[no-untyped-def]
    """Elastic energy of a contact [J]; kn and kt are the stiffnesses at this overlap."""
    share = 0.5 if not hertz else 4.0 / 15.0  # integral of 2/3 kn overlap, kn ~ sqrt(overlap)
    energy = share * kn * overlap * overlap
    if kt > 0.0:
        energy += 0.5 * (sx * sx + sy * sy + sz * sz) / kt
    return energy


@compiled
def rolling_moment(  # type: ignore[no-untyped-def]
    rolling, spring, radius, press, kt, grown, nx, ny, nz, wx, wy, wz, mx, my, mz, twist, dt
):
    """Rolling moment on grain i: a spring of stiffness `spring` kt R*^2, at most rolling R* press.

    Source: Ai, Chen, Rotter & Ooi 2011, doi:10.1016/j.powtec.2010.09.030, type C without
    viscous part.

    Returns:
        moment (3) [N m], energy lost by slip [J], stiffness [N m].
    """
    wn = wx * nx + wy * ny + wz * nz
    wx, wy, wz = wx - wn * nx, wy - wn * ny, wz - wn * nz
    hx, hy, hz = turn_into_plane(mx, my, mz, nx, ny, nz, twist)
    kr = spring * (kt * radius * radius)
    keep = min(1.0, grown)  # as of the tangential spring
    mx, my, mz = keep * hx - kr * dt * wx, keep * hy - kr * dt * wy, keep * hz - kr * dt * wz
    mx, my, mz, slips = slide(mx, my, mz, rolling * radius * press)
    slip = 0.0
    if kr > 0.0 and (slips or grown != 1.0):
        slip = spring_loss(hx, hy, hz, mx, my, mz, wx, wy, wz, kr / grown, kr, dt)
    return mx, my, mz, slip, kr
