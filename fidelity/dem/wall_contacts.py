"""Forces between grains and walls: one contact per local minimum of the distance.

Where a wall is curved, or two walls meet at a shallow angle, a sphere has several contacts with
nearly the same normal that stand for one. They share its stiffness: contact k gets the weight

    w_k = d_k^4 / sum_l g(angle between k and l) d_l^4,   d the overlap,

with g = 1 for normals within 15 degrees, 0 beyond 45 degrees and smooth in between. Every d and w
is continuous in the position of the sphere, so the force is. Histories are kept for a weight of 1:
a spring whose share shrinks keeps its stretch, not its force.
"""

import math

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.crossing import may_have_crossed, note_crossing
from fidelity.dem.law import Pair, contact_force
from fidelity.dem.moving import to_body, to_space
from fidelity.dem.pairs import add_viscous, inverse_contact_mass, rolling_moment, stored
from fidelity.dem.state import (
    CONTACT_DAMPING,
    ELASTIC,
    ENTRIES,
    OVERLAP,
    SLIP,
    WALL_CONTACTS,
    WALL_WORK,
)
from fidelity.dem.triangle import CORNER, EDGE, is_local_minimum, nearest_on_triangle

ONE, TWO = math.cos(math.radians(15)), math.cos(math.radians(45))
# A contact takes over the history of one that it replaces, if their normals are within 45 degrees.
HANDED_ON = TWO


@compiled
def wall_forces(state, walls, surface, law, materials, dt, measure, found, keys):  # type: ignore[no-untyped-def]
    """Add the forces and torques that the walls exert on the grains.

    Args:
        state, walls, surface: see there; loads, histories and wall forces are changed.
        law: see `law`.
        materials: (w, 3) constants of the contact with each wall, see `law.Pair`.
        dt: [s].
        measure: whether to sum the elastic energy in `budget`, too.
        found: (WALL_CONTACTS, 11) scratch.
        keys: (WALL_CONTACTS, 3) scratch.
    """
    place, budget = state.spheres.place, state.budget
    for e in range(state.counts[ENTRIES]):
        i = walls.sphere[e]
        count = find_contacts(
            walls, surface, state.moving, e, place[i, 0], place[i, 1], place[i, 2], place[i, 3],
            found, keys,
        )  # fmt: skip
        if count > 0:
            share_stiffness(found, count)
            take_over_history(walls, e, found, keys, count)
            deepest = 0.0
            for a in range(count):
                deepest = max(deepest, found[a, 3])
                one_contact(state, law, materials, dt, measure, i, found, a, keys[a, 1], keys[a, 2])
                walls.key[e, a] = keys[a, 0]
                for c in range(3):
                    walls.history[e, a, c] = found[a, c]
                for c in range(6):
                    walls.history[e, a, 3 + c] = found[a, 5 + c]
            budget[OVERLAP] = max(budget[OVERLAP], deepest)
            if may_have_crossed(place[i, 3], deepest, state.drift[4], dt):
                note_crossing(state, walls, surface, dt, e)
        walls.touching[e] = count


@inlined
def find_contacts(walls, surface, moving, e, x, y, z, r, found, keys):  # type: ignore[no-untyped-def]
    """Contacts of a sphere: normal (0:3), overlap (3) in `found`; key, body, wall in `keys`."""
    count, now = 0, -1
    lx = ly = lz = 0.0
    for q in range(walls.start[e], walls.start[e + 1]):
        t = walls.triangle[q]
        body = surface.body[t]
        if body != now:
            now = body
            lx, ly, lz = to_body(moving, body, x, y, z)
        tri = surface.triangles[t]
        off = (
            surface.normals[t, 0] * (lx - tri[0])
            + surface.normals[t, 1] * (ly - tri[1])
            + surface.normals[t, 2] * (lz - tri[2])
        )
        if off >= r or off <= -r:
            continue
        dx, dy, dz, where, which = nearest_on_triangle(tri, lx, ly, lz)
        square = dx * dx + dy * dy + dz * dz
        if square >= r * r:
            continue
        key = surface.face_keys[t]
        if where == EDGE:
            key = surface.edge_keys[t, which]
            if key < 0 or not is_local_minimum(
                surface.directions,
                surface.edge_first[t, which],
                surface.edge_last[t, which],
                dx, dy, dz,
            ):  # fmt: skip
                continue
        elif where == CORNER:
            key = surface.corner_keys[t, which]
            if key < 0 or not is_local_minimum(
                surface.directions,
                surface.corner_first[t, which],
                surface.corner_last[t, which],
                dx, dy, dz,
            ):  # fmt: skip
                continue
        distance = math.sqrt(square)
        slot = count
        for a in range(count):  # on the line between two triangles of a flat wall
            if keys[a, 0] == key:
                slot = a
        if slot < count and found[slot, 3] >= r - distance:
            continue
        if slot == WALL_CONTACTS:  # full: the shallowest gives way
            slot = 0
            for a in range(1, count):
                if found[a, 3] < found[slot, 3]:
                    slot = a
            if found[slot, 3] >= r - distance:
                continue
        elif slot == count:
            count += 1
        if distance > 1e-12:
            dx, dy, dz = dx / distance, dy / distance, dz / distance
        else:  # the centre lies in the wall
            dx, dy, dz = surface.normals[t, 0], surface.normals[t, 1], surface.normals[t, 2]
        found[slot, 0], found[slot, 1], found[slot, 2] = to_space(moving, body, dx, dy, dz)
        found[slot, 3] = r - distance
        keys[slot, 0], keys[slot, 1], keys[slot, 2] = key, body, surface.wall[t]
    return count


@inlined
def share_stiffness(found, count):  # type: ignore[no-untyped-def]
    """Weights (4) of the contacts in `found`."""
    for a in range(count):
        own = found[a, 3] ** 4
        total = own
        for b in range(count):
            if b != a:
                cosine = (
                    found[a, 0] * found[b, 0]
                    + found[a, 1] * found[b, 1]
                    + found[a, 2] * found[b, 2]
                )
                s = min(1.0, max(0.0, (cosine - TWO) / (ONE - TWO)))
                total += s * s * (3.0 - 2.0 * s) * found[b, 3] ** 4
        found[a, 4] = own / total if total > 0.0 else 1.0


@inlined
def take_over_history(walls, e, found, keys, count):  # type: ignore[no-untyped-def]
    """Histories (5:11) of the contacts, from the same place or from one that is replaced."""
    before = walls.touching[e]
    for a in range(count):
        source = -1
        for b in range(before):
            if walls.key[e, b] == keys[a, 0]:
                source = b
        if source < 0:
            closest = HANDED_ON
            for b in range(before):
                cosine = (
                    walls.history[e, b, 0] * found[a, 0]
                    + walls.history[e, b, 1] * found[a, 1]
                    + walls.history[e, b, 2] * found[a, 2]
                )
                if cosine > closest:
                    goes_on = False
                    for c in range(count):
                        goes_on = goes_on or keys[c, 0] == walls.key[e, b]
                    if not goes_on:
                        closest, source = cosine, b
        for c in range(6):
            found[a, 5 + c] = walls.history[e, source, 3 + c] if source >= 0 else 0.0


@inlined
def one_contact(state, law, materials, dt, measure, i, found, a, body, wall):  # type: ignore[no-untyped-def]
    """Force of contact `a` in `found` on the grain of sphere `i`."""
    bodies, place, moving, budget = state.bodies, state.spheres.place, state.moving, state.budget
    kin = bodies.kinematics
    g = state.spheres.owner[i]
    r = place[i, 3]
    nx, ny, nz, overlap, weight = found[a, 0], found[a, 1], found[a, 2], found[a, 3], found[a, 4]
    arm = r - 0.5 * overlap
    cx, cy, cz = place[i, 0] - arm * nx, place[i, 1] - arm * ny, place[i, 2] - arm * nz
    ax, ay, az = cx - kin[g, 0], cy - kin[g, 1], cz - kin[g, 2]
    wx, wy, wz = kin[g, 6], kin[g, 7], kin[g, 8]
    ox, oy, oz = moving.spin[body, 0], moving.spin[body, 1], moving.spin[body, 2]
    bx = cx - moving.pivot[body, 0] - moving.place[body, 0]
    by = cy - moving.pivot[body, 1] - moving.place[body, 1]
    bz = cz - moving.pivot[body, 2] - moving.place[body, 2]
    qx = moving.velocity[body, 0] + oy * bz - oz * by
    qy = moving.velocity[body, 1] + oz * bx - ox * bz
    qz = moving.velocity[body, 2] + ox * by - oy * bx
    ux = kin[g, 3] + wy * az - wz * ay - qx
    uy = kin[g, 4] + wz * ax - wx * az - qy
    uz = kin[g, 5] + wx * ay - wy * ax - qz
    twist = 0.5 * dt * ((wx + ox) * nx + (wy + oy) * ny + (wz + oz) * nz)
    inverse_mass = 1.0
    if law.zeta > 0.0:
        inverse_mass = inverse_contact_mass(bodies, g, ax, ay, az, nx, ny, nz)
    pair = Pair(materials[wall, 0], materials[wall, 1], materials[wall, 2])
    fx, fy, fz, sx, sy, sz, press, kn, kt, grown, slip, vx, vy, vz = contact_force(
        law, pair, r, weight, overlap, nx, ny, nz, ux, uy, uz,
        weight * found[a, 5], weight * found[a, 6], weight * found[a, 7], twist, inverse_mass, dt,
    )  # fmt: skip
    full = 1.0 / max(weight, 1e-30)  # as it would be with a share of 1
    found[a, 5], found[a, 6], found[a, 7] = full * sx, full * sy, full * sz
    budget[SLIP] += slip
    mean = moving.mean_velocity[body]
    px, py, pz = moving.mean_spin[body, 0], moving.mean_spin[body, 1], moving.mean_spin[body, 2]
    qx = mean[0] + py * bz - pz * by
    qy = mean[1] + pz * bx - px * bz
    qz = mean[2] + px * by - py * bx
    budget[WALL_WORK] += (fx * qx + fy * qy + fz * qz) * dt
    if law.zeta > 0.0:
        budget[CONTACT_DAMPING] += (vx * qx + vy * qy + vz * qz) * dt
        add_viscous(bodies.viscous, g, 1.0, ax, ay, az, vx, vy, vz)
    if measure:
        budget[ELASTIC] += stored(law.hertz, kn, kt, overlap, sx, sy, sz)
        if law.adhesion > 0.0:
            budget[ELASTIC] -= 2.0 * math.pi * law.adhesion * r * weight * overlap
    kin[g, 9] += fx
    kin[g, 10] += fy
    kin[g, 11] += fz
    kin[g, 12] += ay * fz - az * fy
    kin[g, 13] += az * fx - ax * fz
    kin[g, 14] += ax * fy - ay * fx
    state.wall_force[wall, 0] -= fx
    state.wall_force[wall, 1] -= fy
    state.wall_force[wall, 2] -= fz
    if law.rolling > 0.0:
        mx, my, mz, slip, kr = rolling_moment(
            law.rolling, law.rolling_spring, r, press, kt, grown, nx, ny, nz,
            wx - ox, wy - oy, wz - oz,
            weight * found[a, 8], weight * found[a, 9], weight * found[a, 10], twist, dt,
        )  # fmt: skip
        found[a, 8], found[a, 9], found[a, 10] = full * mx, full * my, full * mz
        budget[SLIP] += slip
        budget[WALL_WORK] += (mx * px + my * py + mz * pz) * dt
        if measure and kr > 0.0:
            budget[ELASTIC] += 0.5 * (mx * mx + my * my + mz * mz) / kr
        kin[g, 12] += mx
        kin[g, 13] += my
        kin[g, 14] += mz
