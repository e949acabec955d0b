"""Spheres whose centre went through a wall: springs then push them out on its other side.

An overlap with a wall cannot exceed the radius, so no limit of the overlap shows it. The way of
the last step does: it leads through a triangle.
"""

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.moving import to_body, way_on_body
from fidelity.dem.state import CROSSED
from fidelity.dem.triangle import nearest_on_triangle

IN_PLANE = 1e-9  # [radius] a centre this close to a triangle lies in it
# A sphere is looked at if its centre is nearer to a wall than this [radius] and twice the way of
# the fastest sphere in a step; that is known from when the neighbour lists were made.
NEAR, FASTER = 0.25, 2.0


@inlined
def may_have_crossed(r, overlap, speed, dt):  # type: ignore[no-untyped-def]
    """Whether a centre is so near to a wall that it may have come through in the last step."""
    return r - overlap < NEAR * r + FASTER * dt * speed


@compiled
def note_crossing(state, walls, surface, dt, e):  # type: ignore[no-untyped-def]
    """Note in `counts` which wall the centre of a listed sphere went through, or lies in."""
    i = walls.sphere[e]
    g = state.spheres.owner[i]
    if state.bodies.left[g]:
        return
    kin, place, moving = state.bodies.kinematics, state.spheres.place, state.moving
    x, y, z, tiny = place[i, 0], place[i, 1], place[i, 2], IN_PLANE * place[i, 3]
    bx, by, bz = x - kin[g, 0], y - kin[g, 1], z - kin[g, 2]
    vx = kin[g, 3] + kin[g, 7] * bz - kin[g, 8] * by
    vy = kin[g, 4] + kin[g, 8] * bx - kin[g, 6] * bz
    vz = kin[g, 5] + kin[g, 6] * by - kin[g, 7] * bx
    for q in range(walls.start[e], walls.start[e + 1]):
        t = walls.triangle[q]
        body, tri, normal = surface.body[t], surface.triangles[t], surface.normals[t]
        lx, ly, lz = to_body(moving, body, x, y, z)
        dx, dy, dz = way_on_body(moving, body, x, y, z, vx, vy, vz, dt)
        now = normal[0] * (lx - tri[0]) + normal[1] * (ly - tri[1]) + normal[2] * (lz - tri[2])
        before = now - normal[0] * dx - normal[1] * dy - normal[2] * dz
        if min(now, before) > tiny or max(now, before) < -tiny:
            continue
        share = 0.0 if abs(now) <= tiny else min(1.0, now / (now - before))
        px, py, pz, _, _ = nearest_on_triangle(
            tri, lx - share * dx, ly - share * dy, lz - share * dz
        )
        if px * px + py * py + pz * pz <= tiny * tiny:
            state.counts[CROSSED] = surface.wall[t] + 1
